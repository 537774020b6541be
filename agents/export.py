"""From Stable-Baselines3's models to :class:`agents.policy.Policy`."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.vec_env import VecNormalize

from agents.policy import Policy, fold


def export(model: BaseAlgorithm, normalisation: VecNormalize | None, card: dict[str, Any]) -> Policy:
    """The deterministic policy of a model of PPO, SAC or TD3.

    Args:
        model: trained, with a multilayer perceptron as its policy.
        normalisation: of its observations, which are not clipped.
        card: kept with it.
    """
    policy: Any = model.policy
    if isinstance(model, PPO):
        parts = [*policy.mlp_extractor.policy_net, policy.action_net]
    elif isinstance(model, SAC):
        parts = [*policy.actor.latent_pi, policy.actor.mu]
    else:
        parts = [part for part in policy.actor.mu if not isinstance(part, torch.nn.Tanh)]
    linear = [part for part in parts if isinstance(part, torch.nn.Linear)]
    layers = [(_array(part.weight), _array(part.bias)) for part in linear]
    if normalisation is not None:
        statistics: Any = normalisation.obs_rms
        layers = fold(layers, statistics.mean, np.sqrt(statistics.var + normalisation.epsilon))
    hidden = "tanh" if any(isinstance(part, torch.nn.Tanh) for part in parts) else "relu"
    return Policy(layers, hidden, not isinstance(model, PPO), card)


def _array(tensor: torch.Tensor) -> np.ndarray:
    return tensor.detach().cpu().numpy().astype(np.float64)
