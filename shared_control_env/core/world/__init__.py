"""What drives and where: the car, the road, the other vehicles, and the scene that sensors give of them."""
