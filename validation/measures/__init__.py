"""What is read off an analysis: norms, probes, condition, cost, drawings."""
