"""What the end to end tests share: a hand on a bus, the daemon as a process, its clients, the comparison."""
