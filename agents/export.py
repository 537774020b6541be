"""Conversion of Stable-Baselines3 models to :class:`shared_control_env.learned.policy.Policy`."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.vec_env import VecNormalize

from shared_control_env.learned.policy import Policy, as_array64, fold


def export(model: BaseAlgorithm, normalisation: VecNormalize | None, card: dict[str, Any]) -> Policy:
    """The deterministic policy of a model of PPO, SAC or TD3.

    Args:
        model: a trained model with a multilayer perceptron as its policy.
        normalisation: normalisation of its observations, which must not be clipped; None if there is none.
        card: card that is stored with the policy.
    """
    policy: Any = model.policy
    if isinstance(model, PPO):
        parts = [*policy.mlp_extractor.policy_net, policy.action_net]
    elif isinstance(model, SAC):
        parts = [*policy.actor.latent_pi, policy.actor.mu]
    else:
        parts = [part for part in policy.actor.mu if not isinstance(part, torch.nn.Tanh)]
    linear = [part for part in parts if isinstance(part, torch.nn.Linear)]
    layers = [(as_array64(part.weight), as_array64(part.bias)) for part in linear]
    if normalisation is not None:
        statistics: Any = normalisation.obs_rms
        layers = fold(layers, statistics.mean, np.sqrt(statistics.var + normalisation.epsilon))
    hidden = "tanh" if any(isinstance(part, torch.nn.Tanh) for part in parts) else "relu"
    return Policy(layers, hidden, not isinstance(model, PPO), card)
