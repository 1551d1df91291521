"""What is measured on the simulated platform; see docs/reference/benchmarks.md."""
