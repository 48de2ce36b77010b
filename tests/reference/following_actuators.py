"""Actuators that follow the contacts, in numpy: the position stage of the method `optimal`.

An implementation of `docs/algorithm.md`, "Actuators: `follow`", without history and budgets. There is no optimum to compare the
daemon's places with, but there is a recipe, which says which of the nearly equal arrangements a frame ends in, and which id stands where.
Everything is remembered under names, with no thought of speed; distances are computed anew for each contact.

Places are single precision, sums double, in the order of the contact list; `np.cumsum` and `np.bincount` add in order.
"""

import numpy as np
from contact_clusters import NOWHERE, Clusters, F, in_order, squared

SWAPS = 4
LEAST_SHARE, QUIET_SHARE, FIRST_FRAMES, QUIET_FRAMES, RANKED = 0.002, 0.1, 4, 4, 64
PATIENCE, TRIED_POINTS, MOST_TRIES = 2.0, 1000, 4
TRIES, MOST_FOUND, NEAR_LEAST, DOUBT = 4, 8, 1.06, 1.25
MOST_RAISED, MOST_GIVEN, TRADES = 5, (0.02, 0.01), 2
STEPS_A_PITCH, RAISED_SHARE = 4.75, 0.25


def neighbour_distance(modules):
    """Distance of neighbouring taxels, millimetres, of modules of taxels' places x and y: half the reach on the hand laid flat."""
    near = []
    for places in modules:
        at = np.unique(np.asarray(places, dtype=F), axis=0).astype(np.float64)
        apart = ((at[:, None] - at[None, :]) ** 2).sum(axis=2)
        apart[apart == 0] = np.inf
        near += [square for row in apart for square in row if square <= 1.001 * row.min() < np.inf]
    return sorted(near)[len(near) // 2] ** 0.5 if near else 1.0


def next_of(xy, module=None):
    """The neighbours of a hand's taxels, by place: the next one of the same module in the row, and in the column; None where there is none.

    xy: (N, 2), of all taxels. module: (N,), which module each belongs to; one for all where it is left out.
    """
    taxels = sorted((0 if module is None else module[n], int(y), int(x)) for n, (x, y) in enumerate(xy))
    found = {(x, y): [None, None] for _, y, x in taxels}
    for (a, y, x), (b, v, u) in zip(taxels, taxels[1:]):
        if (a, y) == (b, v):
            found[x, y][0] = (u, v)
    taxels.sort(key=lambda taxel: (taxel[0], taxel[2], taxel[1]))
    for (a, y, x), (b, v, u) in zip(taxels, taxels[1:]):
        if (a, x) == (b, u):
            found[x, y][1] = (u, v)
    return found


def heights(forces, xy, neighbours, reach=2.0, force_distance=1.0):
    """Of contacts in the order of their list: how far their forces are above the least. None without a difference."""
    rho = np.asarray(forces, dtype=np.float64)
    if len(rho) == 0 or rho.max() == rho.min():
        return None
    force_at = {(int(x), int(y)): force for (x, y), force in zip(xy, rho)}
    pairs = [[(a, neighbours[a][axis]) for a in force_at if neighbours[a][axis] in force_at] for axis in (0, 1)]
    across, down = (in_order([abs(force_at[b] - force_at[a]) for a, b in of]) for of in pairs)
    step, count, fewest = across + down, len(pairs[0]) + len(pairs[1]), len(rho) - 1
    if count < fewest:
        spread = in_order(np.abs(rho - in_order(rho) / len(rho))) / len(rho)
        step += (fewest - count) * spread
    step = max(step / max(count, fewest), (rho.max() - rho.min()) / len(rho))
    return force_distance * (reach / 2) / (STEPS_A_PITCH * step) * (rho - rho.min())


class Follower(Clusters):
    """Frames in, actuators out."""

    def __init__(self, actuators, jump_gain=0.04, reach=2.0):
        super().__init__(actuators)
        self.jump_gain, self.reach = jump_gain, F(reach)
        self.stood = [None] * actuators  # where each id stood when it last pressed
        self.pressed = np.zeros(actuators, dtype=bool)
        self.id_of = {}  # of the last frame's contacts, by place
        self.judged = None  # cost at which no swap paid
        self.changes = self.tried = self.turn = self.quiet = self.patience = 0
        self.ranking = None
        self.member = {}

    def follow(self, xy, weight=None, height=None):
        """xy: (N, 2), in the order of the contact list. Returns each contact's id, and for each id that presses its contact."""
        places = [(float(x), float(y)) for x, y in xy]
        many = len(xy) > MOST_RAISED * self.k
        raised = None if many else height
        held = self.done and weight is None and places == list(self.id_of)
        if held:
            if not self.looks_further():
                return self.shown, self.member
            if self.rest(raised):
                self.finish()
        else:
            self.ranking = None
            self.quiet = 0
            self.changes += len(set(places) ^ set(self.id_of))
            self.bound = self.pressed.copy()
            self.take(xy, weight)
            adopted = [self.id_of.get(place) for place in places]
            self.raise_contacts(raised)
            self.tall[:] = 0
            self.pass_through(adopted) if len(xy) <= self.k else self.gather(adopted)
        self.id_of = dict(zip(places, self.label.tolist()))
        self.shown = self.traded(height, held) if many and height is not None and weight is None else self.label
        return self.shown, self.member

    # N_C <= K_A

    def pass_through(self, adopted):
        label = [
            i if i is not None and self.bound[i] and self.stood[i] == tuple(p) else None
            for i, p in zip(adopted, self.xy.tolist())
        ]
        near = sorted(
            (squared(p, self.stood[i]), n, i)
            for n, p in enumerate(self.xy)
            for i in range(self.k)
            if label[n] is None and self.bound[i] and i not in label
        )
        for distance, n, i in near:
            if distance <= self.reach * self.reach and label[n] is None and i not in label:
                label[n] = i
        for n, p in enumerate(self.xy):
            if label[n] is None:
                label[n] = min((i for i in range(self.k) if i not in label), key=lambda i: (*self.rank_of_unused(i, p), i))
        self.label = np.array(label, dtype=int)
        self.at[self.label] = self.xy
        self.pressed[:] = False
        self.pressed[self.label] = True
        taken = self.exchanged()
        self.label = np.argsort(taken)[self.label]
        self.at = self.at[taken]
        self.member = {i: n for n, i in enumerate(self.label.tolist())}
        for i, n in self.member.items():
            self.stood[i] = tuple(self.xy[n].tolist())
        self.done, self.judged, self.patience, self.turn = True, None, 0, 0

    def rank_of_unused(self, i, place):
        if self.stood[i] is None:
            return (1, 0.0)
        distance = squared(place, self.stood[i])
        if self.bound[i]:
            return (3, distance)
        return (0 if distance <= F(4) * self.reach * self.reach else 2, distance)

    # N_C > K_A

    def gather(self, adopted):
        self.moved = np.zeros(self.k, dtype=bool)
        self.patience += 1
        if np.all(self.at[:, 0] == NOWHERE):
            self.at[0] = self.xy[0]
        been = [i for i in range(self.k) if self.at[i, 0] != NOWHERE]
        nearest = lambda p: min(been, key=lambda i: squared(p, self.at[i]))
        self.label = np.array([nearest(p) if i is None else i for i, p in zip(adopted, self.xy)])
        self.add_up()
        self.centre()
        self.settle()
        if self.wake():
            self.settle()
        self.improve()
        self.finish()

    def wake(self):
        woke = False
        lost = int(np.count_nonzero(self.bound & (self.sums[:, 2] == 0)))
        for jumps in (False, True):
            for i in range(self.k):
                if self.sums[i, 2] > 0 or self.moved[i] or self.bound[i] != jumps:
                    continue
                n = int(np.argmax(self.near))
                if self.near[n] == 0:
                    return woke
                if jumps and self.weight[n] * float(self.near[n]) * lost <= self.gain() * self.cost():
                    return woke
                self.at[i], self.tall[i] = self.xy[n], self.height[n]
                self.moved[i] = woke = True
                d, dz = (self.xy - self.xy[n]) ** 2, self.height - self.height[n]
                self.near = np.minimum(self.near, d[:, 0] + d[:, 1] + dz * dz)
        return woke

    # Swaps

    def gain(self):
        """What a swap is asked to save for each jump, as a share of the cost."""
        return RAISED_SHARE * self.jump_gain if self.raised and self.jump_gain < 1 else self.jump_gain

    def quiet_gain(self):
        """What a swap is asked to save for each jump in a quiet frame: the less, the longer none was made."""
        return self.gain() * QUIET_SHARE * PATIENCE / (PATIENCE + self.patience)

    def improve(self):
        cost = self.cost()
        if self.judged is not None and 16 * self.changes < len(self.xy):
            if abs(cost - self.judged) <= 0.5 * self.gain() * self.judged:
                return
        made = 0
        while made < SWAPS and any(self.make(swap) for swap in self.best_swaps(made > 0)):
            made += 1
            self.patience = self.turn = 0
        self.changes = self.tried = 0
        self.judged = self.cost() if made < SWAPS else None

    def looks_further(self):
        """Counts a frame like the last. Returns whether it is used to look for better clusters."""
        if len(self.xy) <= self.k:
            return False
        self.patience += 1
        self.quiet += 1
        return self.quiet <= FIRST_FRAMES or self.quiet % QUIET_FRAMES == 0

    def rest(self, height):
        """In a frame like the last. Returns whether anything has changed."""
        self.bound = self.pressed.copy()
        self.moved = np.zeros(self.k, dtype=bool)
        changed = False
        if height is not None:
            self.raise_contacts(height)
            self.add_up()
            for i in range(self.k):
                if self.sums[i, 2] > 0:
                    self.tall[i] = self.sums[i, 3] / self.sums[i, 2]
            self.ranking = None
            changed = self.assign()
            if changed:
                self.centre()
            changed = changed + self.move_single_contacts() > 0
            if changed:
                self.settle()
        if self.jump_gain < 1 and self.look_further():
            self.ranking = None
            changed = True
        return changed

    def look_further(self):
        """Tries swaps in the order of their ranking. Returns whether one was made."""
        if not self.ranking:
            self.began = self.patience
            losses, splits = self.losses(), self.splits()
            pairs = [(-(gain - losses[d]), d, s) for s, (gain, _) in splits.items() for d in range(self.k) if d != s]
            self.ranking = sorted(pairs)[:RANKED] if self.k <= RANKED else []
        for _ in range(min(max(TRIED_POINTS // len(self.xy), 1), MOST_TRIES)):
            if self.tried >= len(self.ranking):
                if self.patience >= 2 * self.began:
                    self.tried, self.began = 0, self.patience
                return False
            _, dissolved, split = self.ranking[self.tried]
            self.tried += 1
            halves = self.splits()[split][1]
            if self.make((dissolved, split, halves, self.asked(dissolved, split, halves[0], self.quiet_gain()))):
                self.tried = self.patience = 0
                return True
        return False

    def is_bound(self, i):
        return self.bound[i] and not self.moved[i]

    def way(self, i, to):
        """Squared distance of a place from where a bound id stood."""
        if not self.is_bound(i):
            return 0.0
        dx, dy = (float(F(b) - F(a)) for a, b in zip(self.stood[i], to[:2]))
        return dx * dx + dy * dy

    def asked(self, dissolved, split, kept, gain):
        reach = float(self.reach) ** 2
        jumps = int(self.is_bound(dissolved)) + int(self.way(split, kept) > reach)
        cost = self.cost()
        return max(LEAST_SHARE * cost, jumps * (gain * max(cost, reach)))

    def losses(self):
        """What it costs to dissolve each cluster: its contacts go to their second nearest centroids, or it merges with another."""
        near, next = (d.astype(np.float64) for d in (self.near, self.next))
        joined = self.sums[self.second, 2]
        share = np.where(joined > 0, joined / (joined + self.weight), 1.0)
        loss = np.bincount(self.label, weights=self.weight * (share * next - near), minlength=self.k)
        n, m = self.sums[:, None, 2], self.sums[None, :, 2]
        dx, dy = np.moveaxis((self.at[:, None] - self.at[None]).astype(np.float64), 2, 0)
        dz = (self.tall[:, None] - self.tall[None]).astype(np.float64)
        with np.errstate(invalid="ignore"):
            merged = n * m * (dx * dx + dy * dy + dz * dz) / (n + m)
        possible = (n > 0) & (m > 0) & ~np.eye(self.k, dtype=bool)
        return np.minimum(loss, np.where(possible, merged, np.inf).min(axis=1))

    def splits(self):
        """What each cluster gains by being halved across its principal axis, and its halves, that nearer to where it stood first."""
        found = {}
        w, x, y = self.weight, *self.xy.T.astype(np.float64)
        cx, cy = self.at.T.astype(np.float64)
        dx, dy = x - cx[self.label], y - cy[self.label]
        moments = [np.bincount(self.label, weights=m, minlength=self.k) for m in (w * dx * dx, w * dx * dy, w * dy * dy)]
        for i, (xx, xy, yy) in enumerate(zip(*moments)):
            half = 0.5 * (xx - yy)
            root = np.sqrt(half * half + xy * xy)
            axis = (half + root, xy) if half >= 0 else (xy, root - half)
            side = (self.label == i) & (dx * axis[0] + dy * axis[1] > 0)
            one = np.array([in_order((w * v)[side]) for v in (x, y, np.ones(len(x)), self.height.astype(np.float64))])
            other = self.sums[i] - one
            if one[2] <= 0 or other[2] <= 0:
                continue
            a, b = (half[[0, 1, 3]] / half[2] for half in (one, other))
            ax, ay, az = a - b
            gain = one[2] * other[2] / self.sums[i, 2] * (ax * ax + ay * ay + az * az)
            a, b = a.astype(F), b.astype(F)
            found[i] = (gain, (b, a) if self.way(i, b) < self.way(i, a) else (a, b))
        return found

    def best_swaps(self, again):
        """(dissolved, split, halves, what it is asked to save), in the order they are tried in."""
        losses, found, (most, doubt) = self.losses(), [], self.most_tried()
        for split, (gain, halves) in self.splits().items():
            for bound in (False, True):
                others = [i for i in range(self.k) if i != split and self.is_bound(i) == bound]
                if others:
                    dissolved = min(others, key=lambda i: losses[i])
                    asked = self.asked(dissolved, split, halves[0], self.gain())
                    beyond = gain - losses[dissolved] - asked
                    found.append((beyond, (dissolved, split, halves, asked if beyond > 0 else doubt * asked)))
        found.sort(key=lambda swap: -swap[0])
        sure = [swap for beyond, swap in found[:most] if beyond > 0]
        doubtful = [swap for beyond, swap in found[:most] if beyond <= 0 and most > 1]
        return self.in_turn(sure, doubtful) if len(self.xy) > 3 * self.k and not again else sure + doubtful

    def in_turn(self, sure, doubtful):
        yield from sure
        if doubtful:
            first = 2 * (self.turn % ((len(doubtful) + 1) // 2))
            self.turn += 1
            yield from doubtful[first : first + 2]

    def most_tried(self):
        over = len(self.xy) - self.k
        if not self.raised or over > self.k:
            return TRIES, DOUBT
        pitch = 0.5 * float(self.reach)
        far = self.cost() > NEAR_LEAST * (0.5 * pitch * pitch * over)
        return MOST_FOUND if far else 1, 1

    def make(self, swap):
        """Makes a swap, and unmakes it unless it saves what it is asked to."""
        if swap is None:
            return False
        dissolved, split, halves, asked = swap
        kept = ("at", "tall", "sums", "near", "next", "second", "label", "moved", "done")
        before, saved = self.cost(), {name: np.copy(getattr(self, name)) for name in kept}
        self.moved[dissolved] = True
        (self.at[split], self.tall[split]), (self.at[dissolved], self.tall[dissolved]) = ((half[:2], half[2]) for half in halves)
        most = before - asked
        if self.settle(most) and self.cost() < min(before, most):
            return True
        for name, value in saved.items():
            setattr(self, name, value)
        return False

    # The last step with many contacts

    def traded(self, height, held):
        """Ids of the contacts, where those between two actuators go to the one whose contacts are pressed like them."""
        label = self.label.copy()
        at = np.column_stack([self.xy.astype(np.float64), np.asarray(height, dtype=np.float64)])
        count = np.bincount(label, minlength=self.k).astype(np.float64)
        sums = np.column_stack([np.bincount(label, weights=v, minlength=self.k) for v in at.T])
        with np.errstate(invalid="ignore"):
            mean = sums / count[:, None]

        def costs(n, i):
            d = at[n] - mean[i]
            d = d * d
            return d[0] + d[1], d[2]

        far, unlike = (in_order(v) for v in zip(*(costs(n, i) for n, i in enumerate(label))))
        left, stand = MOST_GIVEN[not held] * far, set(self.member.values())
        for _ in range(TRADES):
            moved = False
            for n in range(len(label)):
                own, to = label[n], self.second[n]
                if own == to or n in stand or count[to] == 0:
                    continue
                out, into = count[own] / (count[own] - 1), count[to] / (count[to] + 1)
                (far_out, unlike_out), (far_in, unlike_in) = costs(n, own), costs(n, to)
                given = far_in * into - far_out * out
                got = unlike_out * out - unlike_in * into
                if given <= left and got > 0 and given * unlike < got * far:
                    left -= given
                    for i, sign in ((own, -1.0), (to, 1.0)):
                        count[i] += sign
                        sums[i] += sign * at[n]
                        mean[i] = sums[i] / count[i]
                    label[n] = to
                    moved = True
            if not moved:
                break
        return label

    # Where they stand

    def exchanged(self):
        """The cluster that each id takes, so that as many as can go a little way where one would jump."""
        taken = list(range(self.k))
        near = lambda i, to: not self.bound[i] or squared(self.at[to], self.stood[i]) <= self.reach * self.reach
        for jumper in range(self.k) if self.k <= RANKED else ():
            left = taken[jumper]
            if not self.pressed[jumper] or near(jumper, left):
                continue
            ways = [[jumper]]  # ids, each of which is to take the cluster of the next, and the last the one that is left
            seen = {}
            for way in ways:
                if left in seen:
                    break
                for to in range(self.k):
                    if self.pressed[to] and to not in seen and near(way[-1], to):
                        seen[to] = way
                        ways.append([*way, taken.index(to)])
                        if to == left:
                            break
            if left in seen:
                clusters = [taken[i] for i in seen[left][1:]] + [left]
                for i, cluster in zip(seen[left], clusters):
                    taken[i] = cluster
        return np.array(taken)

    def finish(self):
        self.pressed = self.sums[:, 2] > 0
        taken = self.exchanged()
        takes = np.argsort(taken)
        self.label, self.second = takes[self.label], takes[self.second]
        self.at, self.tall, self.sums = self.at[taken], self.tall[taken], self.sums[taken]
        self.done = self.done and bool(np.all(self.pressed))
        step = F(0.125) * self.reach * self.reach
        least, self.member = {}, {}
        for n, i in enumerate(self.label.tolist()):
            distance = self.near[n]
            if self.bound[i]:
                way = squared(self.xy[n], self.stood[i])
                distance = distance + step * F(int(way > 0) + int(way > self.reach * self.reach))
            if i not in least or distance < least[i]:
                least[i], self.member[i] = distance, n
        for i, n in self.member.items():
            self.stood[i] = tuple(self.xy[n].tolist())
