"""What could not be carried, and what was carried as something near it: one list a shot, said and written beside it."""


class Refused(Exception):
    """The shot cannot be exported; the text says why and how to mend it."""


class Report:
    def __init__(self):
        self.lines = []

    def add(self, what, how):
        """`what`: the thing by its name; `how`: what becomes of it."""
        line = f"{what}: {how}"
        if line not in self.lines:
            self.lines.append(line)

    def text(self):
        return "".join(f"{line}\n" for line in self.lines) or "everything is carried\n"


def wrapped(text, width_px, measure_px):
    """Lines of whole words, none wider than a width but for a word that is; `measure_px` gives the width of words."""
    lines = []
    for word in text.split():
        if lines and measure_px(f"{lines[-1]} {word}") <= width_px:
            lines[-1] += f" {word}"
        else:
            lines.append(word)
    return lines
