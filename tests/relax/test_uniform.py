"""Directions drawn uniformly: the generator's published answers, and twins that draw the same."""

import numpy as np
import pytest

from dvr_cli.backend import COMPILED
from dvr_cli.relax.uniform import philox, unit_vectors
from needs import require

# The known answers of Philox4x32-10 that its authors publish with Random123: counter, key, result.
ANSWERS = (
    ((0, 0, 0, 0), (0, 0), (0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8)),
    ((0xFFFFFFFF,) * 4, (0xFFFFFFFF,) * 2, (0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD)),
    (
        (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344),
        (0xA4093822, 0x299F31D0),
        (0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1),
    ),
)
SEEDS = (0, 7, 2**64 - 1)
SWEEPS = (0, 3, 2**32 - 1)
VERTICES = np.concatenate([np.arange(200), [2**32 - 1, 2**32, 2**62]])


def drawn(vertices, seed, sweep, d, draw=unit_vectors):
    result = np.empty((len(vertices), d))
    draw(vertices, np.uint64(seed), np.uint64(sweep), result)
    return result


@pytest.mark.parametrize(("counter", "key", "answer"), ANSWERS)
def test_the_generator_gives_its_published_answers(counter, key, answer):
    words = tuple(np.array([word, word], dtype=np.uint64) for word in counter)
    assert [word.tolist() for word in philox(words, np.uint64(key[0] | key[1] << 32))] == [
        [word, word] for word in answer
    ]


def answered(vertex, seed, sweep, d):
    """A unit vector as the method says, in Python's own integers and with no array."""
    for attempt in range(100):
        a, b, c, e = vertex % 2**32, vertex >> 32, sweep, attempt
        left, right = seed % 2**32, seed >> 32
        for _ in range(10):
            one, other = 0xD2511F53 * a, 0xCD9E8D57 * c
            a, b = (other >> 32) ^ b ^ left, other % 2**32
            c, e = (one >> 32) ^ e ^ right, one % 2**32
            left, right = (left + 0x9E3779B9) % 2**32, (right + 0xBB67AE85) % 2**32
        u, v = ((x if x < 2**63 else x - 2**64) // 2**11 / 2**52 for x in (a + (b << 32), c + (e << 32)))
        if 0 < u * u + v * v < 1:
            square = u * u + v * v
            if d == 2:
                return [u / square**0.5, v / square**0.5]
            width = 2 * (1 - square) ** 0.5
            return [u * width, v * width, 1 - 2 * square]
    raise AssertionError("never within the circle")


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize(("seed", "sweep"), list(zip(SEEDS, SWEEPS, strict=True)))
def test_a_vector_is_that_of_its_seed_sweep_and_vertex(d, seed, sweep):
    vectors = drawn(VERTICES, seed, sweep, d)
    expected = [answered(int(vertex), seed, sweep, d) for vertex in VERTICES]
    np.testing.assert_allclose(vectors, expected, rtol=1e-15)
    np.testing.assert_allclose(np.linalg.norm(vectors, axis=1), 1, rtol=1e-15)


@pytest.mark.parametrize("d", [2, 3])
def test_twins_draw_the_same_bits(d):
    require("numba")
    twin = COMPILED.twin(unit_vectors)
    many = np.random.default_rng(0).permutation(40_000)  # more than are drawn at a time
    for vertices, seed, sweep in (
        (many, 5, 3),
        *((VERTICES, *pair) for pair in zip(SEEDS, SWEEPS, strict=True)),
    ):
        assert drawn(vertices, seed, sweep, d, twin).tobytes() == drawn(vertices, seed, sweep, d).tobytes()
