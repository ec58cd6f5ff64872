"""The physics of each scenario: atmosphere, vehicle, truth, instruments, navigator, and the ensemble kernel.

Frames and signs, used by every module of the reentry:

- Motion is planar, eastward in the equatorial plane of a spherical, rotating earth. The polar state is
  ``(r, theta, r_dot, theta_dot)`` with ``theta`` positive east and never wrapped.
- ``f_x`` is the horizontal specific force, positive east; ``f_z`` the vertical one, **positive down**.
- The inertial *reference axes* are the local horizontal (east) and vertical (down) at one range angle of the
  trajectory, normally that of the start of navigation.

Steady flight (``steady*``) is not planar and its earth does not turn; its axes are in `mcnav.physics.steady.truth`.
"""
