"""Rules about trees: nodes, how they grow, and how they rewire."""
