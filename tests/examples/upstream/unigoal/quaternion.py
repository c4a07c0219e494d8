class quaternion:  # noqa: N801 - upstream's name
    def __init__(self, w, x, y, z):
        self.w, self.x, self.y, self.z = w, x, y, z
