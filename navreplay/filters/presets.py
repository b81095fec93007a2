"""Named methods: each a composition of a moment rule and a noise adapter."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from difflib import get_close_matches
from typing import Any

from navreplay.adapt.fixed import Fixed
from navreplay.adapt.inflation.h_infinity import HInfinity
from navreplay.adapt.inflation.partial_tracking import PartialTracking
from navreplay.adapt.inflation.strong_tracking import StrongTracking
from navreplay.adapt.likelihood.em import Em, PrintedEm
from navreplay.adapt.likelihood.maximum_likelihood import GeneticLikelihood, MaximumLikelihood
from navreplay.adapt.likelihood.variational_bayes import VariationalBayes
from navreplay.adapt.redundant.eiakf import Eiakf
from navreplay.adapt.redundant.ermakf import Ermakf
from navreplay.adapt.redundant.ermakf_derived import ErmakfDerived
from navreplay.adapt.redundant.ermakf_whitened import ErmakfWhitened
from navreplay.adapt.redundant.srmakf import Srmakf
from navreplay.adapt.robust.correntropy import Correntropy
from navreplay.adapt.robust.huber import Huber
from navreplay.adapt.robust.student_t import StudentT
from navreplay.adapt.windowed.iae import Iae
from navreplay.adapt.windowed.iae_q import IaeQ
from navreplay.adapt.windowed.sage_husa import SageHusa
from navreplay.calibration.auto import Auto
from navreplay.calibration.em_offline import EmOffline
from navreplay.calibration.review import Review
from navreplay.calibration.settled import Calibration
from navreplay.filters.weights import Imm, Immae, Mmae, MmaeFloor
from navreplay.moments.cubature import Cubature
from navreplay.moments.invariant import Invariant
from navreplay.moments.linearised import Linearised, MomentRule
from navreplay.plugins import load_plugins, told_apart
from navreplay.timeline import LogError
from navreplay.update.adapter import NoiseAdapter

__all__ = ["PRESETS", "BankPreset", "Method", "Preset", "build_method", "known_methods"]


@dataclass(frozen=True, slots=True)
class Method:
    """What the epoch loop runs. name: of the preset. calibration: where the noise is first estimated from the whole log.
    considers: with biases that are not estimated (see `navreplay.filters.consider`). tracking: inflates the prior before the
    adapter sees it. weighting: of a bank of which rule and adapter make each hypothesis. review: looks at the solution, and may
    ask for another pass."""

    name: str
    rule: MomentRule
    adapter: NoiseAdapter[Any]
    calibration: Calibration | None = None
    considers: bool = False
    tracking: PartialTracking | None = None
    weighting: Mmae | None = None
    review: Review | None = None


@dataclass(frozen=True, slots=True)
class Preset:
    """name, one line of description, and the types of adapter, moment rule, calibration and tracking, whose fields are the
    parameters."""

    name: str
    description: str
    adapter: Callable[..., NoiseAdapter[Any]]
    rule: Callable[..., MomentRule] = Linearised
    calibration: Callable[..., Calibration] | None = None
    considers: bool = False
    tracking: Callable[..., PartialTracking] | None = None
    review: Callable[..., Review] | None = None

    @property
    def parameters(self) -> Mapping[str, Any]:
        """Names and defaults of the parameters."""
        parts = (self.adapter, self.rule, self.calibration, self.tracking, self.review)
        return {name: default for part in parts if part for name, default in _defaults(part).items()}

    def build(self, parameters: Mapping[str, object]) -> Method:
        """The method with parameters, all of them known, replaced."""
        rule, adapter = (_share_of(part, parameters) for part in (self.rule, self.adapter))
        calibration = self.calibration(**_share_of(self.calibration, parameters)) if self.calibration else None
        tracking = self.tracking(**_share_of(self.tracking, parameters)) if self.tracking else None
        review = self.review(**_share_of(self.review, parameters)) if self.review else None
        known = self.rule(**rule), self.adapter(**adapter), calibration, self.considers, tracking
        return Method(self.name, *known, review=review)


@dataclass(frozen=True, slots=True)
class BankPreset:
    """name, one line of description, and the type of the weighting, whose fields are the parameters."""

    name: str
    description: str
    weighting: Callable[..., Mmae]

    @property
    def parameters(self) -> Mapping[str, Any]:
        """Names and defaults of the parameters."""
        return _defaults(self.weighting)

    def build(self, parameters: Mapping[str, object]) -> Method:
        """The method with parameters, all of them known, replaced. Raises LogError where a bank cannot be made of the inner
        method."""
        weighting = self.weighting(**parameters)
        inner = build_method(weighting.inner)
        if inner != Method(inner.name, Linearised(), inner.adapter):
            raise LogError(
                f"filter '{self.name}': parameter 'inner' cannot be '{inner.name}'; take 'fixed' or a method of first order "
                "that does no more than adapt the noise"
            )
        return Method(self.name, inner.rule, inner.adapter, weighting=weighting)


def _defaults(part: Callable[..., Any]) -> dict[str, Any]:
    return {field.name: field.default for field in fields(part)}  # type: ignore[arg-type]


def _share_of(part: Callable[..., Any], parameters: Mapping[str, Any]) -> dict[str, Any]:
    return {name: parameters[name] for name in _defaults(part) if name in parameters}


PRESETS: dict[str, Preset | BankPreset] = {
    preset.name: preset
    for preset in (
        Preset("checked", "iekf, with the noise that the whole log bears out (the default)", Fixed, Invariant, review=Review),
        Preset("fixed", "extended Kalman filter with the noise it is told", Fixed),
        Preset("ekf", "extended Kalman filter in the direct formulation: the same as fixed (Lou et al. 2019)", Fixed),
        Preset(
            "iekf",
            "the same with the error on SE2(3), for large errors of attitude (Barrau and Bonnabel 2017)",
            Fixed,
            Invariant,
        ),
        Preset("eckf", "biases reckoned with but not estimated (Schmidt 1966, Lou et al. 2019)", Fixed, considers=True),
        Preset("psteckf", "eckf with a fading factor on P (Lou et al. 2019)", Fixed, considers=True, tracking=PartialTracking),
        Preset("iae", "R from the innovations of a window (Mohamed and Schwarz 1999)", Iae),
        Preset("iae-q", "R and Q from corrections and residuals of a window (Mohamed and Schwarz 1999)", IaeQ),
        Preset("sage-husa", "R as a fading mean over the innovations (Sage and Husa 1969)", SageHusa),
        Preset("huber", "outlying measurements weighted down (Huber 1964, Karlgaard and Schaub 2007)", Huber),
        Preset("student-t", "measurement noise with Student's t distribution (Piche et al. 2012)", StudentT),
        Preset("correntropy", "outlying measurements and priors weighted by a Gaussian kernel (Chen et al. 2017)", Correntropy),
        Preset("vb", "R by variational Bayes (Särkkä and Nummenmaa 2009)", VariationalBayes),
        Preset("ml", "R of greatest likelihood over a window, by SQP (Gao et al. 2021)", MaximumLikelihood),
        Preset("ml-ga", "the same by differential evolution, slow (Gao et al. 2021)", GeneticLikelihood),
        Preset(
            "em-kf",
            "R by expectation maximisation at each epoch, P too from two iterations on (Lai et al. 2022)",
            Em,
        ),
        Preset("em-kf-printed", "the same with equation (30) as printed", PrintedEm),
        Preset("em-offline", "R and Q by expectation maximisation over the whole log", Fixed, calibration=EmOffline),
        Preset("auto", "noise as the whole log shows it: scale, steps, heavy tails, errors that stay", Fixed, calibration=Auto),
        Preset("strong-tracking", "prior inflated by a fading factor (Zhou and Frank 1996, Lou et al. 2019)", StrongTracking),
        Preset("h-infinity", "prior widened against the worst case (Simon 2006, Zhang et al. 2015)", HInfinity),
        Preset("ckf", "cubature Kalman filter with the noise it is told (Arasaratnam and Haykin 2009)", Fixed, Cubature),
        Preset("hrckf", "h-infinity with cubature (Zhang et al. 2015)", HInfinity, Cubature),
        Preset("mcsckf", "correntropy with cubature (Liu et al. 2018)", Correntropy, Cubature),
        Preset("mlckf", "ml with cubature (Gao et al. 2021)", MaximumLikelihood, Cubature),
        Preset("mlckf-ga", "ml-ga with cubature (Gao et al. 2021)", GeneticLikelihood, Cubature),
        Preset("eiakf", "R from innovations, correlated ones taken for AR(1) (Ghaleb et al. 2017)", Eiakf),
        Preset("srmakf", "R from differences of consecutive epochs against the INS (Ge et al. 2020)", Srmakf),
        Preset("ermakf", "srmakf with random weights, and Burg's method where noise is doubtful (Ge et al. 2020)", Ermakf),
        Preset("ermakf-derived", "R from differences over lags and from redundancy, fitted for correlation", ErmakfDerived),
        Preset("ermakf-whitened", "ermakf-derived with R enlarged for noise that stays", ErmakfWhitened),
        BankPreset("mmae", "bank of filters with scaled Q or R, weighted by likelihood (Magill 1965)", Mmae),
        BankPreset("mmae-floor", "the same with a floor under the weights (Maybeck 1982)", MmaeFloor),
        BankPreset("imm", "the same, hypotheses that follow one another with told probability (Blom and Bar-Shalom 1988)", Imm),
        BankPreset("immae", "the same, weights made even when recent measurements contradict them (Si et al.)", Immae),
    )
}


def known_methods() -> dict[str, Preset | BankPreset]:
    """The presets by name, and behind them those that other packages register under `navreplay.filters`; of equal names the one
    here counts, with a warning. Raises LogError for a plug-in that cannot be loaded."""
    loaded = load_plugins("navreplay.filters", Preset, BankPreset)
    plugins = told_apart("navreplay.filters", (one for one in loaded if isinstance(one, Preset | BankPreset)), PRESETS)
    return {one.name: one for one in plugins} | PRESETS


def build_method(name: str, parameters: Mapping[str, object] | None = None) -> Method:
    """The method of a preset with its parameters replaced.

    Raises LogError for an unknown name or parameter, or a value of the wrong type, with what would be valid.
    """
    known = PRESETS if name in PRESETS else known_methods()
    if name not in known:
        raise LogError(f"filter: there is no '{name}'; {_suggest(name, list(known))}")
    preset = known[name]
    defaults = preset.parameters
    checked: dict[str, object] = {}
    for key, value in (parameters or {}).items():
        if key not in defaults:
            raise LogError(f"filter '{name}': there is no parameter '{key}'; {_suggest(key, list(defaults))}")
        checked[key] = _check_value(name, key, value, defaults[key])
    return preset.build(checked)


def _suggest(wrong: str, known: list[str]) -> str:
    near = get_close_matches(wrong, known, n=1)
    return f"did you mean '{near[0]}'?" if near else f"known are: {', '.join(known) or 'none'}"


def _check_value(name: str, key: str, value: object, default: object) -> object:
    """value where it is of the kind of default: a name, numbers (as a tuple) or a number."""
    if isinstance(default, str):
        if not isinstance(value, str):
            raise LogError(f"filter '{name}': parameter '{key}' must be a name in quotes, got {value!r}")
        return value
    if not isinstance(default, tuple):
        _check_number(name, key, value, default)
        return value
    if not isinstance(value, list | tuple) or not value:
        raise LogError(f"filter '{name}': parameter '{key}' must be a list of numbers such as [1, 10], got {value!r}")
    for one in value:
        _check_number(name, key, one, default[0])
    return tuple(value)


def _check_number(name: str, key: str, value: object, default: object) -> None:
    whole = isinstance(default, int)
    if isinstance(value, bool) or not isinstance(value, int if whole else (int, float)):
        wanted = "a whole number" if whole else "a number"
        raise LogError(f"filter '{name}': parameter '{key}' must be {wanted}, got {value!r}")
    if value <= 0:
        raise LogError(f"filter '{name}': parameter '{key}' must be positive, got {value!r}")
