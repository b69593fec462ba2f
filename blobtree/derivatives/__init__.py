"""Exact derivatives of fields: Hessians and curvatures, and kernels for derivatives by parameters."""
