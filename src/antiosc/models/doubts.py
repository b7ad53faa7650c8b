"""Why the impact at a site of a map is doubtful, and what helps."""

from antiosc.base.texts import SMALLER_CELLS

#: Reasons.
CUT = "an edge cuts the patch"
SUPPORTED = "supports hold a part of it"
EDGE = "an edge or a corner is struck"
HOLLOW = "a hollow is too narrow for the striker"
PIERCED = "the striker pierces the part elsewhere"
BEYOND_WALL = "the force exceeds that on a wall"
#: Reason -> what leaves fewer doubtful sites.
REMEDIES = {
    CUT: "take a smaller radius of the patch (on the page: Site; in a scene: [map] radius), on"
    f" cells not larger than it ({SMALLER_CELLS})",
    SUPPORTED: "hold the part elsewhere, or map another face",
    EDGE: "map one face (on the page: click it, then Map; in a scene: [map] where)",
    HOLLOW: "take a smaller striker",
    PIERCED: "take a smaller striker",
    BEYOND_WALL: f"take cells smaller than the radius of the patch ({SMALLER_CELLS})",
}
