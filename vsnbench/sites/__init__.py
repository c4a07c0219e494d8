"""The site file: rooms, walls, objects, goals and starting positions."""
