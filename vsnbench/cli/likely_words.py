"""What people type in their first hour that is no word of ours, and what they want: data for `refusals`."""

from collections.abc import Mapping

_EPISODES = "`vsnbench episodes list` has the attempts, `vsnbench db status` the campaigns"
_RUN = "`vsnbench run --model pirlnav --goal chair` runs trials"
_RESUME = "the same `vsnbench run ...` goes on with the trials that are left"
_PAGE = "`--output report/` writes report.html with all its figures, `--serve` shows it"
_PLACE = "`--results DIR` says where the record lies"
_WHICH = "`--starts 1-5` chooses starting positions, `--repetitions 3` has each goal tried so often"
_WATCH = "`--live` shows each episode in Rerun as it happens, `vsnbench view N` afterwards"
_JUDGE = "`--confirm` takes the proposal, `--distance 0.84` a measured distance, which decides"

VERBS: Mapping[str, str] = {
    "help": "`vsnbench -h`, or `vsnbench run -h`",
    "version": "`vsnbench --version`",
    "list": _EPISODES,
    "ls": _EPISODES,
    "status": _EPISODES,
    "log": _EPISODES,
    "show": "`vsnbench episodes show 17`, `vsnbench sites show apartment`, `vsnbench models show pirlnav`",
    "evaluate": _RUN,
    "eval": _RUN,
    "test": _RUN,
    "benchmark": _RUN,
    "bench": _RUN,
    "start": _RUN,
    "resume": _RESUME,
    "continue": _RESUME,
    "simulate": "`vsnbench run` drives a simulated robot; `vsnbench ros1 simulate` plays one over ROS",
    "sim": "`vsnbench run` drives a simulated robot; `vsnbench ros1 simulate` plays one over ROS",
    "plot": "`vsnbench report --output report/` draws the figures",
    "figures": "`vsnbench report --output report/` draws the figures",
    "results": "`vsnbench report` has the success rates; " + _EPISODES,
    "console": "`vsnbench run ... --console` serves the operator's page",
    "web": "`vsnbench report --serve`, `vsnbench view 17 --web`, or `vsnbench run ... --console`",
    "serve": "`vsnbench models serve` for a model, `vsnbench report --serve` for a report",
    "edit": "`vsnbench sites edit lab.yaml`",
    "scan": "`vsnbench sites scan --robot turtlebot2 --output flat`",
    "check": "`vsnbench sites check`, `vsnbench models check`, `vsnbench robots check`, `vsnbench study check`",
    "new": "`vsnbench init DIR`, `vsnbench models new DIR`, `vsnbench study new`",
    "merge": "`vsnbench db merge OTHER`",
    "backup": "`vsnbench db backup FILE`",
}
"""Words in a verb's place."""

SUBCOMMANDS: Mapping[tuple[str, str], str] = {
    ("sites", "new"): "`vsnbench sites edit lab.yaml` draws one, `vsnbench init DIR` writes one to fill in",
    ("config", "set"): "vsnbench.toml says it, which `vsnbench init` writes: `vsnbench config show` has what holds",
    ("episodes", "delete"): "nothing is deleted: `vsnbench judge N --void WHY` takes it out of the rates",
    ("episodes", "view"): "`vsnbench view N`",
    ("episodes", "judge"): "`vsnbench judge N`",
}
"""A group of verbs, and a word in it."""

SAME: Mapping[str, tuple[str, ...]] = {
    "validate": ("check",),
    "verify": ("check",),
    "lint": ("check",),
    "test": ("check",),
    "ls": ("list",),
    "create": ("new", "generate"),
    "make": ("new", "generate"),
    "add": ("new", "edit"),
    "info": ("show", "status"),
    "get": ("show",),
    "cat": ("show",),
    "describe": ("show",),
    "start": ("run",),
    "resume": ("run",),
    "view": ("draw", "show"),
    "plot": ("draw",),
    "map": ("scan", "draw"),
    "results": ("report",),
    "compare": ("report",),
    "download": ("fetch",),
    "install": ("fetch",),
}
"""A word that other tools have -> ours for the same."""

OPTIONS: Mapping[tuple[str, str], str] = {
    ("", "-v"): "`vsnbench --version`",
    ("", "-V"): "`vsnbench --version`",
    ("report", "--html"): _PAGE,
    ("report", "--pdf"): _PAGE,
    ("report", "--plot"): _PAGE,
    ("report", "--figures"): _PAGE,
    ("run", "--sim"): "a simulated robot is what drives where no --robot is given",
    ("run", "--simulated"): "a simulated robot is what drives where no --robot is given",
    ("run", "--simulate"): "a simulated robot is what drives where no --robot is given",
    ("run", "--output"): _PLACE,
    ("run", "-o"): _PLACE,
    ("run", "--out"): _PLACE,
    ("run", "--results-dir"): _PLACE,
    ("run", "--log-dir"): _PLACE,
    ("run", "--starting-positions"): "`--starts 1-5`",
    ("run", "--positions"): "`--starts 1-5`",
    ("run", "--episodes"): _WHICH,
    ("run", "--num-episodes"): _WHICH,
    ("run", "--trials"): _WHICH,
    ("run", "-n"): _WHICH,
    ("run", "--steps"): "`--max-steps 20`",
    ("run", "--dry-run"): "`--starts 1` tries one trial, and the same command without it goes on from there",
    ("run", "--gui"): _WATCH,
    ("run", "--render"): _WATCH,
    ("run", "--viewer"): _WATCH,
    ("run", "--visualize"): _WATCH,
    ("run", "--rerun"): _WATCH,
    ("run", "--video"): _WATCH,
    ("run", "--headless"): "no window opens where --live is not asked for",
    ("run", "--resume"): "none is needed: " + _RESUME,
    ("run", "--continue"): "none is needed: " + _RESUME,
    ("run", "--parallel"): "`--workers N`; as many as fit are taken by themselves",
    ("run", "--jobs"): "`--workers N`; as many as fit are taken by themselves",
    ("run", "-j"): "`--workers N`; as many as fit are taken by themselves",
    ("run", "--checkpoint"): "`--weights FILE`",
    ("run", "--ckpt"): "`--weights FILE`",
    ("run", "--config"): "`--model-config FILE`",
    ("run", "--gpu"): "`--device cuda`",
    ("run", "--cuda"): "`--device cuda`",
    ("run", "--cpu"): "`--device cpu`",
    ("run", "--env"): "`--site lab.yaml`",
    ("run", "--scene"): "`--site lab.yaml`",
    ("run", "--map"): "`--site lab.yaml`",
    ("run", "--target"): "`--goal chair`",
    ("run", "--object"): "`--goal chair`",
    ("run", "--category"): "`--goal chair`",
    ("run", "--policy"): "`--model pirlnav`",
    ("run", "--agent"): "`--model pirlnav`",
    ("judge", "--success"): _JUDGE,
    ("judge", "--succeeded"): _JUDGE,
    ("judge", "--failure"): _JUDGE,
    ("judge", "--fail"): _JUDGE,
}
"""A verb, or nothing for the program itself, and an option."""

VALUES: Mapping[tuple[str, str], str] = {
    ("run", "seed"): "`--seeds 0-9` has a campaign for each",
    ("view", "episode"): "`vsnbench episodes list` has their numbers",
    ("judge", "number"): "`vsnbench judge --pending` has their numbers",
    ("episodes show", "number"): "`vsnbench episodes list` has their numbers",
    ("export bag", "number"): "`vsnbench episodes list` has their numbers",
    ("report", "campaign"): "`vsnbench db status` has their numbers",
}
"""A verb, and a parameter whose value does not fit."""
