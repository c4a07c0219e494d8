"""Rankings of several models: measures and table."""

from vsnbench.report.analysis.conditions import footnotes
from vsnbench.report.comparison.ranking import Ranking
from vsnbench.report.measures import COUNT, NUMBER, TEXT, TEXTS, Measure, Measures, objects, rates
from vsnbench.report.table import ReportTable, TableCell
from vsnbench.report.wording import compared, listed
from vsnbench.statistics.multiple import Ranks

_RANK, _GROUP = (
    "best and worst rank of the model; 1 is the best",
    "no difference is shown between models that share a letter",
)
_OVERALL = 'p-value of "no model differs from the others"'
RANKED = Measures(
    Measure("", TEXT, _RANK, lambda ranked: _ranks(ranked.ranks), heading="rank"),
    Measure("name", TEXT, "name of the condition", "condition.name", heading="model", note=""),
    *rates("proportion", "interval"),
    Measure(
        "letters",
        TEXT,
        "two models have a letter in common if their comparison shows no difference",
        heading="group",
        note=_GROUP,
    ),
    Measure("best_rank", COUNT, "best rank that the comparisons allow", "ranks.best"),
    Measure("worst_rank", COUNT, "worst rank that the comparisons allow", "ranks.worst"),
)
RANKING = Measures.shared(
    "ranking",
    Measure("goals", TEXTS, "goals that all models share"),
    Measure("cells", COUNT, "number of cells that all models share; 0 if the sites differ"),
    Measure("starts", COUNT, "number of starting positions in these cells"),
    Measure("p", NUMBER, _OVERALL, null="without shared cells"),
    Measure("questions", COUNT, "number of p-values in the correction of the pairs", "pairs"),
    Measure("models", objects(RANKED), "one object per model, the best first"),
)


def ranking_table(ranking: Ranking) -> ReportTable:
    """Return the ranking of several models, best first."""
    notes = []
    if ranking.p is not None:
        notes.append(
            f"Overall test: p {compared(ranking.p)} for no difference between the models, on the {ranking.cells} cells "
            f"of {ranking.starts} starting positions that all models share (Cochran's Q as a permutation test within "
            "starting positions)."
        )
    notes.append(
        f"Two models share a letter if their comparison, Holm-corrected for {ranking.pairs} comparisons, shows no "
        "difference. The ranks are those that the comparisons do not exclude."
    )
    title = f"All models on their shared goals: {listed(ranking.goals)}"
    names = footnotes([ranked.condition for ranked in ranking.models])
    return RANKED.table("ranking", title, ranking.models, notes=tuple(notes), footnotes=names)


def _ranks(ranks: Ranks) -> TableCell:
    return TableCell(str(ranks.best) if ranks.best == ranks.worst else f"{ranks.best} to {ranks.worst}", ranks.best)
