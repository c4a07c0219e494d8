"""Draws goals of every kind in the site editor, as a person does with mouse and keyboard."""

from tests.web.site_editor.drawing import Drawing

GOAL_IDS = {
    "text": ("red-armchair", "open-floor", "desk-plant"),
    "image": ("photo-bed", "photo-sofa"),
    "instruction": ("to-the-rug", "to-the-desk"),
}


class GoalDrawing(Drawing):
    """Adds goals to a copy of the apartment."""

    def add(self, kind: str, name: str, text: str = "", starts: str = "") -> None:
        """Add a goal and type its fields; the last value is applied by what is clicked next."""
        self.page.select_option("#new-goal-kind", kind)
        self.page.click("#add-goal")
        self.page.keyboard.press("Control+a")  # the id has the focus
        self.page.keyboard.type(name)
        if starts:
            self.page.click("#field-starts")
            self.page.keyboard.type(starts)
        if text:
            self.page.click("#field-text")
            self.page.keyboard.type(text)

    def press(self, button: str) -> None:
        self.page.get_by_role("button", name=button, exact=True).click()

    def photo(self) -> None:
        """Take a photograph, and wait until the page shows it."""
        self.press("Take a photo from the twin")
        self.page.wait_for_function("() => document.querySelector('img.photo')?.naturalWidth > 0")

    def draw_all(self) -> None:
        """Draw 3 text, 2 image and 2 instruction goals; one target is a region, another a point."""
        self.add("text", "red-armchair", "the red armchair")
        self.press("Choose targets on the plan")
        self.click((0.65, 3.4))
        self.add("text", "open-floor", "the open floor between the dining table and the sofa")
        self.press("Add a point")
        self.click((4.3, 3.5))
        self.add("text", "desk-plant", "the plant next to the desk")
        self.press("Choose targets on the plan")
        self.click((4.3, 0.4), (5.5, 1.05), (5.5, 1.05))  # the chair is chosen and removed
        self.add("image", "photo-bed")
        self.page.select_option("#field-add-target", "bed-1")
        self.photo()
        self.add("image", "photo-sofa")
        self.press("Choose targets on the plan")
        self.click((3.4, 1.9))
        self.press("Place the camera on the plan")
        self.page.mouse.move(*self.pixels(6.0, 1.9))
        self.page.mouse.down()
        self.page.mouse.move(*self.pixels(4.0, 1.9), steps=4)
        self.page.mouse.up()
        self.photo()
        self.add("instruction", "to-the-rug", "go into the bedroom and stop on the rug", "1-15")
        self.press("Draw a region")
        self.click((7.6, 4.55), (9.2, 4.55), (9.2, 5.2), (7.6, 5.2))
        self.page.keyboard.press("Enter")
        self.field("name", "rug")
        self.add("instruction", "to-the-desk", "pass the sofa and stop at the desk", "7, 8, 10-12")
        self.page.select_option("#field-add-target", "desk")
