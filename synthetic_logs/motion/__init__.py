"""How the vehicle moves: manoeuvres on the ground and in the air, a ballistic flight. Uses the core; a new motion is a file
or a manoeuvre here.
"""
