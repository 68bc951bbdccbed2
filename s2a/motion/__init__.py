"""Motions of a robot arm: where it can stand, reach and move along a path; skills made of segments; corrections.

In come a robot, a room (`sim.usd` or a scan) and a skill's settings; out come bases, joint paths and joint targets over time, or
a reason for each base that does not serve. Searches know no simulation; stages of skills and the policy do.
"""
