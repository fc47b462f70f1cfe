"""Which topic of a car carries each signal: the candidates, the evidence, the choice, and the questions."""
