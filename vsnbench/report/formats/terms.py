"""Terms that the page of a report explains."""

GLOSSARY = (
    ("k/n, SR", "Successful episodes of the counted episodes, one per trial; the success rate is their ratio."),
    (
        "95 % interval",
        (
            "Wilson's interval at the effective sample size, which is less than n if several episodes share a starting "
            "position."
        ),
    ),
    (
        "success",
        (
            "The model chose STOP within the success distance of the nearest instance of the goal, before any limit of "
            "the protocol and without a collision."
        ),
    ),
    ("actions", "Mean over all episodes, as in the paper; the second column covers the successful episodes only."),
    ("SPL, SoftSPL", "Success, or progress, weighted by shortest path length over driven path length; 0 to 1."),
    (
        "SCT",
        (
            "Success weighted by completion time: the time of the shortest path at the base's greatest speed over the "
            "time taken, which includes thinking on a real robot; 0 to 1."
        ),
    ),
    ("done", "Completed trials of planned trials. Rates of unfinished campaigns can change."),
    (
        "void",
        "Attempts without a result (failed motion, lost sensor, model error, abort, crash).",
    ),
)
