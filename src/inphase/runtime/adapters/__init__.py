"""Thin adapters to what others run: ROS 1, LSL, bags. Each imports its library only when it is used."""
