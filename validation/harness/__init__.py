"""Records, merges, clocks and publishes what studies find; knows no mechanics."""
