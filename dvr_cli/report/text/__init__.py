"""Reports for people: in as many columns as a terminal has, ASCII but for the bars a caller may ask for."""
