"""Reports of measurements: pages, figures, animations, and notes on their quality."""
