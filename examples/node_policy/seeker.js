// A model: it drives to what has the colour that the goal names, and turns or drives ahead until it sees that.

const COLOURS = {
  red: (red, green, blue) => red > 1.6 * Math.max(green, blue, 30),
  green: (red, green, blue) => green > 1.3 * Math.max(red, blue, 30),
  blue: (red, green, blue) => blue > 1.3 * Math.max(red, green, 30),
};

export class ColourSeeker {
  card = {
    name: "colour-seeker",
    goal_kinds: ["text"], // categories arrive as their words
    action_kinds: ["discrete", "waypoint"],
    sensors: ["depth", "rgb"],
  };

  reset({ goal, task }) {
    this.colour = COLOURS[goal.toLowerCase().split(/\W+/).find((word) => word in COLOURS)] ?? (() => false);
    this.nearM = 0.8 * (task?.protocol.success_distance_m ?? 1);
  }

  act({ rgb, depth, camera }) {
    const seen = []; // [distance, bearing] of pixels with the goal's colour
    const focal = camera.width / 2 / Math.tan((camera.horizontal_fov_deg * Math.PI) / 360);
    let free = 2; // metres straight ahead
    for (let row = 2; row < camera.height; row += 4) {
      for (let column = 2; column < camera.width; column += 4) {
        const pixel = row * camera.width + column;
        const far = depth.data.readFloatLE(4 * pixel);
        if (!(far > 0)) continue; // NaN: no depth
        const bearing = -Math.atan((column + 0.5 - camera.width / 2) / focal);
        if (this.colour(...rgb.data.subarray(3 * pixel, 3 * pixel + 3))) seen.push([far / Math.cos(bearing), bearing]);
        if (Math.abs(bearing) < 0.25 && Math.abs(row / camera.height - 0.5) < 0.15) free = Math.min(free, far);
      }
    }
    if (seen.length > 30) {
      const [far, bearing] = seen.sort((a, b) => a[0] - b[0])[seen.length >> 2];
      return far < this.nearM ? { action: "STOP" } : this.#drive(far - 0.6 * this.nearM, bearing);
    }
    return free > 1 ? this.#drive(free - 0.6, 0) : { action: "TURN_LEFT" };
  }

  #drive(far, bearing) {
    const distance = Math.min(Math.max(far, 0.1), 1.5);
    return { movement: { kind: "waypoint", x_m: distance * Math.cos(bearing), y_m: distance * Math.sin(bearing) } };
  }
}
