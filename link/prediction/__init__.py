"""What closed forms predict of a link: light, errors of cells, reach and capacity."""
