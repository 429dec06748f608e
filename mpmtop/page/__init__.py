"""What every page has in common, the report's and a comparison's: numbers, drawings, style. It knows no mechanics."""
