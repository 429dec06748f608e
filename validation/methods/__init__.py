"""The methods that are compared: ours, the references, other people's codes."""
