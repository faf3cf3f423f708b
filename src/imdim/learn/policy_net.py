"""The better design: a policy that writes, executes and looks.

Against `seed_policy`: it reads profiles of target and current cloud along the axes of the target's box instead of one vector each; the
state is the executed one, so one step is one sample and undone steps leave no trace; and each primitive is a short sequence of choices,
every one conditioned on those before, so that the distribution over primitives has as many modes as the shape has next steps. The places
of its ends are pointed at, and the profile along the next axis is taken anew over the points within the ends already chosen.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from imdim.data.canonical import canonical_primitives
from imdim.data.outlines import FORMS, Family, family_of
from imdim.data.solids import ABSENT, BOX, EXTRUDE, REVOLVE, Solids, adds_primitive
from imdim.data.synthesize import APPEND, TrainingSamples
from imdim.learn.attention import Layer, causal
from imdim.learn.codes import (
    BINS,
    COMMON,
    ENDS,
    FIRST,
    FREE,
    NUMBERS,
    PLACES,
    SIGNS,
    STEPS,
    TURNS,
    Choices,
    decode,
    encode,
    encode_signs,
    numbers_of,
    ruler,
    to_bins,
)
from imdim.learn.draft import Draft, StateView
from imdim.learn.pointer import Pointer
from imdim.learn.policy import VOCAB, Move, Policy, Sight, choose_tokens, draw_index, token_log_p
from imdim.learn.profile import COUNTS, SlabTokens, fold_levels, histograms, look
from imdim.learn.regression import Regression
from imdim.learn.rotations import ROTATION_CODES

HEAD = 5  # slots before the ends: token, whose place it takes, sign, turn, form
SLOTS = HEAD + ENDS + NUMBERS
MARGIN = 0.6 / STEPS  # points this far outside of the ends chosen still count as within


@dataclass
class BaseConfig:
    """`gt_points` and `cur_points` are how many points of each cloud are used, `point_width` how many features a point has.

    The switches take a design change back, to measure what it is worth: `feedback` sees the written solid, `pointing` scores marks by what
    is there, `within` looks only at points within the ends chosen so far. Without `local` there is one max-pooled vector of each cloud and
    nothing to point at; without `distributions` ends and numbers are regressed; `rotation` is a key of ROTATION_CODES. What is not
    `canonical` writes as it was taught, which is for samples without `canonical_numbers`.
    """

    d_model: int = 128
    encoder_layers: int = 3
    decoder_layers: int = 2
    heads: int = 4
    gt_points: int = 1024
    cur_points: int = 256
    point_width: int = 48
    offset_weight: float = 4.0
    feedback: bool = True
    pointing: bool = True
    within: bool = True
    local: bool = True
    distributions: bool = True
    rotation: str = "columns"
    canonical: bool = True


class BasePolicy(Policy):
    def __init__(self, config: BaseConfig, max_seq_len: int) -> None:
        """Raises ValueError for a rotation code that is none."""
        super().__init__()
        if config.rotation not in ROTATION_CODES:
            raise ValueError(f"unknown rotation code {config.rotation!r}; known are {', '.join(ROTATION_CODES)}")
        self.config, self.max_seq_len = config, max_seq_len
        d = config.d_model
        self.slabs = SlabTokens(d, config.point_width, config.local)
        self.history = nn.Linear(ENDS + NUMBERS + TURNS + VOCAB + SIGNS + FORMS, d)
        self.order = nn.Parameter(0.02 * torch.randn(max_seq_len, d))
        self.encoder = nn.ModuleList(Layer(d, config.heads) for _ in range(config.encoder_layers))
        self.decoder = nn.ModuleList(Layer(d, config.heads, cross=True) for _ in range(config.decoder_layers))
        self.encoded, self.decoded = nn.LayerNorm(d), nn.LayerNorm(d)
        self.slot = nn.Parameter(0.02 * torch.randn(SLOTS, d))
        heads = (VOCAB, SIGNS, TURNS, FORMS)
        self.token_embed, self.sign_embed, self.turn_embed, self.form_embed = (nn.Embedding(n, d) for n in heads)
        self.place_embed, self.bin_embed = nn.Embedding(PLACES, d), nn.Embedding(BINS * NUMBERS, d)
        self.glance = nn.Linear((STEPS + 1) * (COUNTS + 1), d)
        self.to_token, self.to_sign, self.to_turn, self.to_form = (nn.Linear(d, n) for n in heads)
        # a primitive of the program is pointed at, or none
        self.to_place, self.from_place, self.behind = nn.Linear(d, d), nn.Linear(d, d), nn.Parameter(torch.zeros(d))
        self.pointer = Pointer(d, config.pointing and config.local)
        self.to_bins = nn.Parameter(torch.randn(NUMBERS, d, BINS) * d**-0.5)
        self.to_shifts = nn.Parameter(torch.randn(NUMBERS, d, BINS) * 0.01)
        self.regression = None if config.distributions else Regression(d)

    def losses(self, batch: TrainingSamples) -> dict[str, Tensor]:
        """Cross-entropies (nats) of the step after the prefix that `cur_points` shows; `ends` and `numbers` are sums over a primitive's."""
        tokens, part = batch.following
        adds = adds_primitive(tokens).float()
        view = self._view(batch.gt_points, batch.cur_points, *self._as_seen(batch))
        choices = encode(part, view.low, view.edges, self.config.rotation).as_drawn()
        log_p, shift, logits = self._log_p(view, Draft(tokens, batch.at, encode_signs(part), choices, []))
        count = adds.sum().clamp_min(1)
        parts = {name: -(value * adds).sum() / count for name, value in log_p.items() if name != "token"}
        parts["token"], parts["shift"] = -log_p["token"].mean(), (shift * adds).sum() / count
        loss = sum(value * (self.config.offset_weight if name == "shift" else 1.0) for name, value in parts.items())
        accuracy = (logits.argmax(-1) == tokens).float().mean()
        return {"loss": torch.as_tensor(loss), **parts, "token_accuracy": accuracy}

    def _as_seen(self, batch: TrainingSamples) -> tuple[Solids, Tensor | None]:
        """What a policy is shown of the prefixes: those hidden by how far the target's points are outside of them alone."""
        if not batch.hidden.any():
            return batch.written, None
        with torch.no_grad():
            outside = fold_levels(batch.written, batch.gt_points)
        kinds = torch.where(batch.hidden[:, None], ABSENT, batch.written.kinds)
        return replace(batch.written, kinds=kinds), outside

    def propose(self, seen: Sight, generator: torch.Generator | None = None, ways: int = 1) -> Move:
        view, lengths = self._view(*seen[:3], seen.outside).repeat(ways), seen.written.lengths.repeat_interleave(ways)
        b, device = len(lengths), lengths.device
        zeros = torch.zeros(b, SLOTS, dtype=torch.long, device=device)
        offsets = torch.zeros(b, ENDS + NUMBERS, device=device)
        choices = Choices(zeros[:, 0], zeros[:, 0], zeros[:, :ENDS].clone(), zeros[:, :NUMBERS].clone(), offsets)
        draft = Draft(zeros[:, 0], zeros[:, 0], zeros[:, 0], choices, [])
        token, undo = self.to_token(self._encode_slots(view, draft, 1)[:, 0]), seen.may_undo.repeat_interleave(ways)
        draft.tokens, log_p = choose_tokens(token, lengths, self.max_seq_len - 1, generator, undo, seen.must_add)
        adds = adds_primitive(draft.tokens).float()
        at, log_at = draw_index(self._place_scores(view, self._encode_slots(view, draft, 2)[:, 1], undo), generator)
        draft.at = at - 1
        first = torch.tensor([-torch.inf, 0.0, -torch.inf], device=device)
        opens = (((lengths == 0) & (seen.outside is None)) | (draft.at == 0))[:, None]
        sign = torch.where(opens, first, self.to_sign(self._encode_slots(view, draft, 3)[:, 2]))
        draft.sign, log_sign = draw_index(sign, generator)
        turn, log_turn = draw_index(self.to_turn(self._encode_slots(view, draft, 4)[:, 3]), generator)
        draft.choices = replace(choices, turn=turn)
        form, log_form = draw_index(self._form_scores(draft.tokens, self._encode_slots(view, draft, 5)[:, 4]), generator)
        draft.choices = replace(draft.choices, form=form)
        log_p = log_p + (log_at + log_sign + log_turn + log_form) * adds
        for end in range(ENDS):
            log_p = log_p + self._draw_end(view, draft, end, generator) * adds
        used = draft.choices.mask_used_bins(draft.tokens, self.config.rotation) & (adds > 0)[:, None]
        free = used.any(1).nonzero()[:, 0]
        if len(free):
            log_p = log_p.index_add(0, free, self._draw_numbers(view, draft, free, generator))
        kinds = torch.where(adds > 0, draft.tokens, BOX)
        part = decode(kinds, draft.sign, draft.choices, view.low, view.edges, self.config.rotation)
        at = torch.where(adds > 0, draft.at, APPEND)
        return Move(draft.tokens, canonical_primitives(part) if self.config.canonical else part, log_p, at, draft.draws())

    def log_prob(self, seen: Sight, move: Move) -> Tensor:
        """Of a move that `propose` drew: several draws make one primitive, so it is asked for the draws."""
        if move.draws is None:
            raise ValueError("a move of this policy's own is needed: the primitive does not tell what was drawn")
        ways = len(move.tokens) // len(seen.may_undo)
        lengths, may_undo = (rows.repeat_interleave(ways) for rows in (seen.written.lengths, seen.may_undo))
        view = self._view(*seen[:3], seen.outside).repeat(ways)
        log_p, _, logits = self._log_p(view, Draft.of(move.tokens, move.draws), may_undo)
        token = token_log_p(logits, move.tokens, lengths, self.max_seq_len - 1, may_undo)
        # the first primitive is positive without a choice
        chosen = ((lengths > 0) | (seen.outside is not None)) & (move.at != 0)
        primitive = log_p["at"] + log_p["sign"] * chosen + log_p["turn"] + log_p["form"] + log_p["ends"] + log_p["numbers"]
        return token + primitive * adds_primitive(move.tokens)

    def _place_scores(self, view: StateView, hidden: Tensor, may_replace: Tensor | None = None) -> Tensor:
        """Logits [b, 1 + t] of taking nothing's place, and that of each primitive of the program, for `hidden` [b, d]."""
        behind = (hidden @ self.behind)[:, None]
        scores = (view.past @ self.to_place(hidden)[..., None])[..., 0] * hidden.shape[-1] ** -0.5
        there = view.there[:, 0, 0, -view.past.shape[1] :]
        allowed = there if may_replace is None else there & may_replace[:, None]
        return torch.cat([behind, scores.masked_fill(~allowed, -torch.inf)], 1)

    def _form_scores(self, tokens: Tensor, hidden: Tensor) -> Tensor:
        """Logits [b, FORMS]; what is not drawn from an outline has none, what is has one, and polygons are not turned about an axis."""
        form = torch.arange(FORMS, device=tokens.device)
        family = family_of(form)
        turned = (form > 0) & (family >= Family.TRIANGLE) & (family <= Family.OCTAGON) & (tokens == REVOLVE)[:, None]
        return self.to_form(hidden).masked_fill(((form == 0) == (tokens >= EXTRUDE)[:, None]) | turned, -torch.inf)

    def _draw_end(self, view: StateView, draft: Draft, end: int, generator: torch.Generator | None) -> Tensor:
        """Choose one end in place; its log p [b]."""
        hidden = self._encode_slots(view, draft, HEAD + end + 1)[:, -1]
        if self.regression is not None:
            draft.choices.places[:, end], draft.choices.offsets[:, end] = self.regression.place(hidden, end)
            return torch.zeros_like(hidden[:, 0])
        keys = self._keys(view, draft, end)
        place, log_p = draw_index(self.pointer.scores(hidden, keys), generator)
        draft.choices.places[:, end] = place
        draft.choices.offsets[:, end] = self.pointer.offset(hidden, keys, place)
        return log_p

    def _draw_numbers(self, view: StateView, draft: Draft, rows: Tensor, generator: torch.Generator | None) -> Tensor:
        """Choose the numbers of free rotations and of tapers of `rows` in place; their log p [rows]."""
        view, part = view.only(rows), draft.only(rows)
        code, log_p = ROTATION_CODES[self.config.rotation], torch.zeros(len(rows), device=rows.device)
        used = part.choices.mask_used_bins(part.tokens, self.config.rotation)
        for slot in range(NUMBERS):
            if slot == 3:
                # what a cylinder's x axis is in the data, it is here
                implied, _ = to_bins(code.implied(part.choices.values()[:, ENDS : ENDS + 3]))
                spun = (part.choices.turn == FREE)[:, None] & ~used[:, 3:6]
                part.choices.bins[:, 3:6] = torch.where(spun, implied, 0)
            if not used[:, slot].any():
                continue
            index, shift, log_index = self._draw_bin(self._encode_slots(view, part, HEAD + ENDS + slot + 1)[:, -1], slot, generator)
            part.choices.bins[:, slot] = torch.where(used[:, slot], index, part.choices.bins[:, slot])
            part.choices.offsets[:, ENDS + slot] = shift
            log_p = log_p + log_index * used[:, slot]
        draft.choices.bins[rows], draft.choices.offsets[rows] = part.choices.bins, part.choices.offsets
        return log_p

    def _draw_bin(self, hidden: Tensor, slot: int, generator: torch.Generator | None) -> tuple[Tensor, Tensor, Tensor]:
        """Bin, offset and log p [b] of one number."""
        if self.regression is not None:
            return *self.regression.bin(hidden, slot), torch.zeros_like(hidden[:, 0])
        index, log_p = draw_index(hidden @ self.to_bins[slot], generator)
        return index, (hidden @ self.to_shifts[slot]).gather(1, index[:, None])[:, 0].clamp(-0.5, 0.5), log_p

    def _log_p(self, view: StateView, draft: Draft, may_replace: Tensor | None = None) -> tuple[dict[str, Tensor], Tensor, Tensor]:
        """Log p [b] of each group of a whole draft's choices, the squared errors [b] of its offsets, in steps, and the token's logits."""
        choices, rows = draft.choices, torch.arange(len(draft.tokens), device=draft.tokens.device)
        hidden = self._encode_slots(view, draft, SLOTS)
        used = choices.mask_used_bins(draft.tokens, self.config.rotation)
        if self.regression is not None:
            shift = self.regression.errors(hidden[:, HEAD:], choices, used)
            ends = numbers = torch.zeros_like(shift)
        else:
            ends, numbers, shift = self._choice_losses(view, draft, hidden, used)
        names = ("token", "at", "sign", "turn", "form")
        adds = adds_primitive(draft.tokens)
        logits = [
            self.to_token(hidden[:, 0]),
            self._place_scores(view, hidden[:, 1], may_replace),
            self.to_sign(hidden[:, 2]),
            self.to_turn(hidden[:, 3]),
            self._form_scores(draft.tokens, hidden[:, 4]),
        ]
        # a step that adds nothing has no place and no form to choose
        chosen = (draft.tokens, torch.where(adds, draft.at + 1, 0), draft.sign, choices.turn, torch.where(adds, choices.form, 0))
        each = (scores.log_softmax(-1)[rows, value] for scores, value in zip(logits, chosen, strict=True))
        return {**dict(zip(names, each, strict=True)), "ends": ends, "numbers": numbers}, shift, logits[0]

    def _choice_losses(self, view: StateView, draft: Draft, hidden: Tensor, used: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Log p [b] of the ends and of the `used` numbers, and the squared errors [b] of their offsets."""
        choices, rows = draft.choices, torch.arange(len(draft.tokens), device=draft.tokens.device)
        ends, shift = torch.zeros_like(view.low[:, 0]), torch.zeros_like(view.low[:, 0])
        for end in range(ENDS):
            at, keys, place = hidden[:, HEAD + end], self._keys(view, draft, end), choices.places[:, end]
            ends = ends + self.pointer.scores(at, keys).log_softmax(-1)[rows, place]
            shift = shift + (self.pointer.offset(at, keys, place) - choices.offsets[:, end]).square()
        bins = torch.einsum("bsd,sdk->bsk", hidden[:, HEAD + ENDS :], self.to_bins).log_softmax(-1)
        shifts = torch.einsum("bsd,sdk->bsk", hidden[:, HEAD + ENDS :], self.to_shifts)
        numbers, moved = (v.gather(2, choices.bins[..., None])[..., 0] for v in (bins, shifts))
        shift = shift + ((moved - choices.offsets[:, ENDS:]).square() * used).sum(1)
        return ends, (numbers * used).sum(1), shift

    def _view(self, gt_points: Tensor, cur_points: Tensor, written: Solids, outside: Tensor | None = None) -> StateView:
        low, edges = ruler(gt_points)
        if not self.config.feedback:
            cur_points, written = torch.zeros_like(cur_points), replace(written, kinds=torch.full_like(written.kinds, ABSENT))
        seen, shown = gt_points[:, : self.config.gt_points], cur_points[:, : self.config.cur_points]
        clouds = look(seen, shown, written, low, edges, None if outside is None else outside[:, : seen.shape[1]])
        signs = F.one_hot(torch.where(written.common, COMMON, written.positive.long()), SIGNS)
        kinds, forms = F.one_hot(written.kinds.clamp_min(0), VOCAB), F.one_hot(written.forms, FORMS)
        numbers = numbers_of(written, low, edges, self.config.rotation)
        past = self.history(torch.cat([numbers, kinds, signs, forms], -1)) + self.order[: written.kinds.shape[1]]
        slabs = self.slabs(clouds, edges)
        there = torch.cat([torch.ones_like(slabs[..., 0], dtype=torch.bool), written.present], 1)[:, None, None]
        memory = torch.cat([slabs, past], 1)
        for layer in self.encoder:
            memory = layer(memory, there)
        memory = self.encoded(memory)
        reads = tuple(layer.read(memory) for layer in self.decoder if isinstance(layer, Layer))
        # one vector has no places
        tokens = memory[:, : 3 * (STEPS + 1)] if self.config.local else torch.zeros_like(memory[:, :1]).expand(-1, 3 * (STEPS + 1), -1)
        return StateView(low, edges, clouds, reads, there, tokens.split(STEPS + 1, 1), memory[:, slabs.shape[1] :])

    def _profile(self, view: StateView, draft: Draft, axis: int) -> Tensor:
        """The profile along `axis` of the points within the ends chosen along the axes before it."""
        while len(draft.profiles) <= axis:
            weight, shares, done = None, draft.choices.shares(), len(draft.profiles)
            if done and self.config.within:
                low, high = shares[:, None, 0 : 2 * done : 2] - MARGIN, shares[:, None, 1 : 2 * done : 2] + MARGIN
                seen = view.clouds.shares[..., :done]
                seen = seen.repeat_interleave(len(low) // len(seen), 0)
                weight = ((seen > low) & (seen < high)).all(-1).float()
            profile = histograms(view.clouds, done, weight)
            draft.profiles.append(profile.repeat_interleave(len(shares) // len(profile), 0))
        return draft.profiles[axis]

    def _keys(self, view: StateView, draft: Draft, end: int) -> Tensor:
        from_low = draft.choices.places[:, end - 1] - FIRST if end % 2 else None
        profile = self._profile(view, draft, end // 2) if self.pointer.fixed is None else None
        return self.pointer.keys(view.slabs[end // 2], profile, from_low)

    def _encode_slots(self, view: StateView, draft: Draft, count: int) -> Tensor:
        """Hidden states [b, count, d] of the first `count` slots, each seeing those before it; later choices are not looked at."""
        choices = draft.choices
        number = choices.bins + BINS * torch.arange(NUMBERS, device=choices.bins.device)
        chosen = view.past.gather(1, draft.at.clamp_min(0)[:, None, None].expand(-1, 1, view.past.shape[2]))
        taken = self.from_place(chosen) * (draft.at != APPEND)[:, None, None]
        heads = (self.sign_embed(draft.sign), self.turn_embed(choices.turn), self.form_embed(choices.form))
        before = [torch.zeros_like(view.slabs[0][:, :1]), self.token_embed(draft.tokens)[:, None], taken, *(h[:, None] for h in heads)]
        before += [self.place_embed(choices.places), self.bin_embed(number)[:, :-1]]
        x = (torch.cat(before, 1) + self.slot)[:, :count]
        axes = range((min(ENDS, max(0, count - HEAD)) + 1) // 2)
        if axes and self.config.local:
            glances = torch.stack([self.glance(self._profile(view, draft, axis).flatten(1)) for axis in axes], 1)
            seen = nn.functional.pad(glances.repeat_interleave(2, 1), (0, 0, HEAD, NUMBERS))
            x = x + seen[:, :count]
        for layer, read in zip(self.decoder, view.reads, strict=True):
            x = layer(x, causal(count, x.device), read, view.there)
        return self.decoded(x)
