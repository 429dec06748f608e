"""Any code put through the checks: what it answers, what is expected and why, and where to look if it fails."""
