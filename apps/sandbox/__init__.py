"""The sandbox: a page in the browser for modelling and decals, on top of an edit session."""
