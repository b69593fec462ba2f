"""The contact lab: lessons with text, sliders, live plots and questions, beside the view of the sandbox."""
