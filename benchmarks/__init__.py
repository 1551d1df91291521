"""What is measured on the simulated platform; see docs/reference/benchmarks.md."""

import os

# What is compared over time is measured in the plain twin, unless a benchmark names a world.
os.environ.setdefault("COSMIC_WORLD", "plain")
