"""Records a run of a gateway: everything that enters it from outside, with its time."""
