"""What is derived from highway-env: road, vehicles, pictures, and what else its environments offer."""
