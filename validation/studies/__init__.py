"""One folder for each page of the report: test, helpers and locks; no study imports another."""
