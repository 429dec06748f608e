"""What a report is about, and the order of its studies."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from validation.harness.store import Study


@dataclass(frozen=True)
class Contents:
    """Title and question of the report, the paper it is about, how to cite, and the studies in groups, in their order.

    `topics` and `methods` are the order in which the front page speaks of things and shows designs, `advice` the topic
    of what follows for a reader. What is in no group comes last, by name.
    """

    title: str = "Validation report"
    asked: str = ""
    paper: str = ""
    details: str = ""
    cite: str = ""
    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    topics: tuple[str, ...] = ()
    methods: tuple[str, ...] = ()
    advice: str = ""

    def ordered(self, names: Iterable[str]) -> list[str]:
        """The names of studies in the report's order."""
        place = {name: k for k, name in enumerate(name for group in self.groups.values() for name in group)}
        return sorted(names, key=lambda name: (place.get(name, len(place)), name))

    def grouped(self, studies: Iterable[Study]) -> dict[str, list[Study]]:
        """The studies by group, without the empty ones."""
        group_of = {name: group for group, names in self.groups.items() for name in names}
        grouped: dict[str, list[Study]] = {group: [] for group in (*self.groups, "Other studies")}
        for study in studies:
            grouped[group_of.get(study.name, "Other studies")].append(study)
        return {group: members for group, members in grouped.items() if members}
