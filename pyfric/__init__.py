"""The onset of frictional sliding in a 2D spring-block model.

Source: J. Trømborg et al., Phys. Rev. Lett. 107, 074301 (2011).
"""
