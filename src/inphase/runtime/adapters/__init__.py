"""Thin adapters to what others run: ROS 1, LSL, bags. Each imports its library when it is used, and says what it lacks."""
