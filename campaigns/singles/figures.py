from plays import of_singles as figures
