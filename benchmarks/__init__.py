"""Speed, printed as ratios against peers measured in the same run; nothing here is a test."""
