"""The NexStar driver: operations become the commands of the hand control that was found."""
