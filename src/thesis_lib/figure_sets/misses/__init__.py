"""What the thesis may have computed in chapter 3: a search for what explains the misses."""
