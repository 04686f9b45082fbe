"""One step against opponents: they learn several times, then the generator that they judge.

batch (+ real pairs) -> generator -> views -+-> opponents, scores of true and generated pictures
                                            +-> content terms       |
                    weights of the generator <- total loss, eqs. (3.9), (6.14)

All that is drawn follows from the number of the step.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from camkit.models_def.training.adversarial.content import Features, content_terms
from camkit.models_def.training.adversarial.game import weighted_sum
from camkit.models_def.training.adversarial.opponents import OpponentPlan, Opponents
from camkit.models_def.training.adversarial.views import make_views
from camkit.models_def.training.first_weights import FirstWeights
from camkit.models_def.training.fitter import BETAS, Fitter, Mix, NetworkBuilder, Objective
from camkit.models_def.training.recipe import ContentRecipe, NetworkRecipe
from camkit.models_def.training.sample import Batch
from camkit.models_def.training.schedule import learning_rate


@dataclass(frozen=True, slots=True, kw_only=True)
class PictureParts:
    """Inputs of a fit by the look of a picture, besides a network and its schedule.

    Attributes:
        content: Weights of what is compared.
        to_rec709: (3, 3) white-balanced camera colours to linear Rec.709.
        features: Looked through, or None where nothing looks.
        opponents: Who judges the generator; None for nobody.
        mix: Real pairs, or None.
        first: First weights, or None for random ones.
        device: cpu or cuda.
        betas: Of the generator's AdamW.
    """

    content: ContentRecipe
    to_rec709: Tensor
    features: Features | None = None
    opponents: OpponentPlan | None = None
    mix: Mix | None = None
    first: FirstWeights | None = None
    device: str = "cpu"
    betas: tuple[float, float] = BETAS


def picture_fitter(entry: NetworkRecipe, build: NetworkBuilder, parts: PictureParts) -> Fitter:
    """Return what fits a generator to the content terms, and to opponents where there are any.

    References: Sun 2021, eqs. (3.9), (6.14).
    """
    schedule, device = entry.schedule, torch.device(parts.device)
    features, to_rec709 = parts.features, parts.to_rec709.float().to(device)
    if isinstance(features, torch.nn.Module):
        features = features.to(device)
    opponents: Opponents | None = None

    def loss(fitter: Fitter, batch: Batch, step: int, progress: float) -> Tensor:
        if parts.mix is not None:
            batch = parts.mix(batch, step)
        output = fitter.run(batch.planes, progress)
        views = make_views(output, batch.target.to(device), batch.weight.to(device), to_rec709)
        if opponents is not None:
            decay = learning_rate(schedule, step, progress) / schedule.learning_rate
            opponents.learn(views, step, decay, fitter.note)
        terms = dict(content_terms(views, parts.content, features))
        if opponents is not None:
            terms |= opponents.opinions(views)
        for name, (_, value) in terms.items():
            fitter.note(name, value)
        return weighted_sum(terms)

    if parts.opponents is not None:
        opponents = Opponents(parts.opponents, schedule.seed, device)
    objective = Objective(loss=loss, states={} if opponents is None else {"opponents": opponents})
    return Fitter(entry, build, parts.device, parts.first, objective=objective, betas=parts.betas)
