"""The Predict tab: endpoint force of contact runs from any number of models, beside the load cell."""
