"""How fast drpt is: error against time, cost of growing scenes, start-up, beside Mitsuba 3."""
