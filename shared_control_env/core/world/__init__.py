"""The simulated world: the car, the road, the other vehicles, and the scene that sensors perceive of them."""
