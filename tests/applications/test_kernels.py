"""The five computations of the round-trip application against independent references."""

from __future__ import annotations

import csv
import hashlib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from reconros_zenoh.applications.roundtrip import inputs
from reconros_zenoh.applications.roundtrip.kernels import inverse, mnist
from reconros_zenoh.applications.roundtrip.kernels.hash import sha256, source
from reconros_zenoh.applications.roundtrip.kernels.inverse import inverse_kinematics, pack, unpack
from reconros_zenoh.applications.roundtrip.kernels.sobel import sobel
from reconros_zenoh.applications.roundtrip.kernels.sort import sort
from reconros_zenoh.errors import FileError

# 59 of 1000 requests and answers of the authors' own inverse kinematics, every 17th one.
VECTORS = Path(__file__).parent / "inverse_vectors.csv"


# --- inverse kinematics ---


def test_inverse_kinematics_agrees_with_the_authors_program():
    with VECTORS.open() as file:
        rows = [{name: int(value) for name, value in row.items()} for row in csv.DictReader(file)]
    assert {row["leg"] for row in rows} == set(range(6))
    for row in rows:
        assert pack(row["leg"], row["alpha_q"], row["beta_q"]) == row["input"]
        assert unpack(row["input"]) == (row["leg"], row["alpha_q"], row["beta_q"])
        answer = inverse_kinematics(row["input"])
        assert abs((answer >> 21) - (row["output"] >> 21)) <= 1, row  # ties may fall to the neighbour
        assert answer & 0x1FFFFF == row["output"] & 0x1FFFFF, row


signed_14_bits = st.integers(-(2**13), 2**13 - 1)


@given(st.integers(0, 5), signed_14_bits, signed_14_bits)
def test_every_request_survives_packing_and_has_an_answer(leg, alpha_q, beta_q):
    word = pack(leg, alpha_q, beta_q)
    assert 0 <= word < 2**31
    assert unpack(word) == (leg, alpha_q, beta_q)
    assert unpack(word | 1 << 31) == (leg, alpha_q, beta_q)
    answer = inverse_kinematics(word)
    assert 0 <= answer < 2**32
    assert answer >> 18 & 0x7 == leg
    assert answer & 0x3FFFF == 0


def test_the_answer_is_the_index_whose_arm_tip_is_nearest_to_one_leg_length():
    # Leg 0 of the level platform: its joint (51, 44, 105) is (-51 + 33, 44 - 69, 105) there.
    def miss(index):
        angle = np.deg2rad(index / 10)
        tip = np.array([20 * np.sin(angle), 0, 20 * np.cos(angle)])
        return abs(np.sum((np.array([-18, -25, 105]) - tip) ** 2) - 115**2)

    assert inverse_kinematics(pack(0, 0, 0)) >> 21 == min(range(2048), key=miss)


@pytest.mark.parametrize("leg", [-1, 6, 7])
def test_a_leg_that_does_not_exist_is_refused(leg):
    with pytest.raises(ValueError, match=f"leg {leg} does not exist"):
        pack(leg, 0, 0)


@pytest.mark.parametrize("leg", [6, 7])
@pytest.mark.parametrize("function", [unpack, inverse_kinematics])
def test_a_word_with_a_leg_that_does_not_exist_is_refused(function, leg):
    with pytest.raises(ValueError, match=f"leg {leg} does not exist"):
        function(leg)


@pytest.mark.parametrize(("alpha_q", "beta_q", "name"), [(8192, 0, "alpha_q"), (0, -8193, "beta_q")])
def test_an_angle_that_does_not_fit_is_refused(alpha_q, beta_q, name):
    with pytest.raises(ValueError, match=f"{name} -?819[23] does not fit"):
        pack(0, alpha_q, beta_q)


def test_the_table_of_arm_tips_covers_every_servo_index():
    assert len(inverse.ARM_TIP_X) == len(inverse.ARM_TIP_Z) == 2048
    assert np.allclose(np.hypot(inverse.ARM_TIP_X, inverse.ARM_TIP_Z), 20)


# --- Sobel ---


def sobel_reference(image):
    """The definition, pixel by pixel in int64: kernels [1 2 1; 0 0 0; -1 -2 -1] and its transpose."""
    height, width, _ = image.shape
    kernel = np.array([[1, 2, 1], [0, 0, 0], [-1, -2, -1]])
    gx = gy = np.zeros((height - 2, width - 2, 3), np.int64)
    for row in range(3):
        for column in range(3):
            part = image[row : row + height - 2, column : column + width - 2].astype(np.int64)
            gy = gy + kernel[row, column] * part
            gx = gx + kernel.T[row, column] * part
    edges = np.zeros_like(image)
    edges[1:-1, 1:-1] = (np.abs(gx) + np.abs(gy)) >> 3
    return edges


def extreme_images():
    rng = np.random.default_rng(5)
    shape = (480, 640, 3)
    black = np.zeros(shape, np.uint8)
    yield "black", black
    yield "white", black + 255
    yield "grey", black + 7
    yield "black and white noise", rng.integers(2, size=shape, dtype=np.uint8) * 255
    yield (
        "chessboard",
        np.broadcast_to(np.indices((480, 640)).sum(0)[:, :, None] % 2 * 255, shape).astype(np.uint8),
    )
    yield "corner", np.where(np.indices((480, 640))[:, :, :, None].sum(0) < 500, black, black + 255)
    yield "picture", inputs.images(rng, 1)[0]


@pytest.mark.parametrize("image", [pytest.param(image, id=name) for name, image in extreme_images()])
def test_sobel_equals_its_definition_on_extreme_images(image):
    assert np.array_equal(sobel(image), sobel_reference(image))


@given(st.integers(0, 2**32 - 1))
def test_sobel_equals_its_definition_on_random_images(seed):
    image = np.random.default_rng(seed).integers(256, size=(480, 640, 3), dtype=np.uint8)
    assert np.array_equal(sobel(image), sobel_reference(image))


def test_sobel_of_a_step_is_a_line_of_half_its_height_in_that_channel():
    image = np.zeros((480, 640, 3), np.uint8)
    image[:, 320:, 1] = 255
    edges = sobel(image)
    assert np.all(edges[1:-1, 319:321, 1] == 4 * 255 >> 3)
    edges[1:-1, 319:321, 1] = 0
    assert not edges.any()


def test_sobel_reads_a_received_buffer_and_returns_an_array_of_its_own():
    picture = inputs.images(np.random.default_rng(1), 1)[0]
    received = np.frombuffer(picture.tobytes(), np.uint8).reshape(480, 640, 3)
    assert not received.flags.writeable
    edges = sobel(received)
    assert np.array_equal(edges, sobel_reference(picture))
    assert np.array_equal(received, picture)
    assert edges.flags.writeable
    assert edges.flags.c_contiguous
    assert np.array_equal(sobel(picture[:, ::-1]), sobel_reference(picture[:, ::-1]))


@pytest.mark.parametrize("image", [np.zeros((480, 640), np.uint8), np.zeros((480, 640, 3), np.int16)])
def test_sobel_refuses_another_array(image):
    with pytest.raises(ValueError, match=r"uint8\[480, 640, 3\] is needed, not u?int"):
        sobel(image)


# --- number sorting ---


def odd_even_transposition(numbers):
    """The paper's network: n stages; each compares the neighbours at even, then at odd places."""
    numbers = numbers.copy()
    for stage in range(len(numbers)):
        left, right = numbers[stage % 2 : -1 : 2], numbers[stage % 2 + 1 :: 2]
        left[:], right[:] = np.minimum(left, right), np.maximum(left, right)
    return numbers


@given(hnp.arrays(np.uint32, st.integers(0, 40)))
def test_sort_equals_the_odd_even_transposition_network(numbers):
    before = numbers.copy()
    assert np.array_equal(sort(numbers), odd_even_transposition(numbers))
    assert np.array_equal(numbers, before)


@pytest.mark.parametrize("make", [lambda n: n, np.sort, lambda n: np.sort(n)[::-1], lambda n: n % 3])
def test_sort_equals_the_network_for_the_papers_2048_numbers(make):
    numbers = make(inputs.numbers(np.random.default_rng(3), 1)[0])
    result = sort(numbers)
    assert result.dtype == np.uint32
    assert np.array_equal(result, odd_even_transposition(numbers))


@pytest.mark.parametrize("numbers", [np.zeros(4, np.int32), np.zeros((2, 2), np.uint32)])
def test_sort_refuses_another_array(numbers):
    with pytest.raises(ValueError, match=r"uint32\[n\] are needed, not "):
        sort(numbers)


# --- hash ---


def test_the_hashed_image_counts_its_words_and_cannot_be_changed():
    words = source()
    assert words.nbytes == 1920 * 1080 * 3
    assert words.dtype == np.uint32
    assert np.array_equal(words, range(1555200))
    assert source() is words
    with pytest.raises(ValueError, match="read-only"):
        words[0] = 1


def test_sha256_of_the_image_equals_the_digest_of_its_bytes_in_little_endian():
    message = b"".join(word.to_bytes(4, "little") for word in range(1555200))
    digest = sha256(source())
    assert digest.dtype == np.uint32
    assert b"".join(int(word).to_bytes(4, "big") for word in digest) == hashlib.sha256(message).digest()
    assert np.array_equal(sha256(source().astype(">u4")), digest)


def test_sha256_gives_the_words_of_the_standards_example():
    # FIPS 180-2, Appendix B.1: the message "abc".
    expected = [
        0xBA7816BF,
        0x8F01CFEA,
        0x414140DE,
        0x5DAE2223,
        0xB00361A3,
        0x96177A9C,
        0xB410FF61,
        0xF20015AD,
    ]
    assert sha256(np.frombuffer(b"abc", np.uint8)).tolist() == expected


# --- MNIST ---


@pytest.fixture(scope="module")
def classifier():
    return mnist.Classifier()


def test_the_network_has_the_layers_of_the_paper_and_is_small():
    model = mnist.MODEL.read_bytes()
    assert len(model) < 300_000
    # In an ONNX file a node's operator is field 4, a string: tag 0x22, length, text.
    nodes = {
        name: model.count(bytes([0x22, len(name)]) + name.encode()) for name in ("Conv", "MaxPool", "Gemm")
    }
    assert nodes == {"Conv": 3, "MaxPool": 3, "Gemm": 2}


def test_the_sample_is_classified_at_least_as_well_as_in_the_paper():
    images, labels = inputs.digits()
    assert len(images) == 200
    assert set(labels.tolist()) == set(range(10))
    assert mnist.accuracy(images, labels) >= 0.97


def test_accuracy_is_the_share_of_images_whose_class_is_the_label(classifier):
    images, _ = inputs.digits()
    labels = np.array([classifier.classify(image) for image in images], np.uint8)
    assert mnist.accuracy(images, labels) == 1
    labels[:50] = (labels[:50] + 1) % 10
    assert mnist.accuracy(images, labels) == 0.75


def test_many_threads_may_share_a_classifier(classifier):
    images, _ = inputs.digits()
    alone = [classifier.classify(image) for image in images]
    with ThreadPoolExecutor(8) as pool:
        assert list(pool.map(classifier.classify, [*images, *images])) == alone * 2


def test_a_received_image_that_is_read_only_is_classified(classifier):
    images, _ = inputs.digits()
    received = np.frombuffer(images[0].tobytes(), np.uint8).reshape(28, 28)
    assert classifier.classify(received) == classifier.classify(images[0])


@pytest.mark.parametrize("image", [np.zeros((28, 27), np.uint8), np.zeros((28, 28), np.float32)])
def test_classify_refuses_another_array(classifier, image):
    with pytest.raises(ValueError, match=r"uint8\[28, 28\] is needed, not "):
        classifier.classify(image)


def test_a_model_that_is_missing_or_damaged_is_named(tmp_path):
    with pytest.raises(FileError, match=r"lost\.onnx: the network cannot be read"):
        mnist.Classifier(tmp_path / "lost.onnx")
    (tmp_path / "damaged.onnx").write_bytes(b"\xff" * 100)
    with pytest.raises(FileError, match=r"damaged\.onnx: the network cannot be read"):
        mnist.Classifier(tmp_path / "damaged.onnx")


# --- files of digits ---

IMAGES = np.arange(3 * 28 * 28).astype(np.uint8).reshape(3, 28, 28)
LABELS = np.array([0, 9, 5], np.uint8)


def test_load_digits_returns_what_was_saved(tmp_path):
    np.savez(tmp_path / "digits.npz", images=IMAGES, labels=LABELS)
    images, labels = mnist.load_digits(tmp_path / "digits.npz")
    assert np.array_equal(images, IMAGES)
    assert np.array_equal(labels, LABELS)


@pytest.mark.parametrize(
    ("arrays", "problem"),
    [
        ({"images": IMAGES}, "labels"),
        ({"labels": LABELS}, "images"),
        ({"images": IMAGES[:, 1:], "labels": LABELS}, r"images is uint8\[3, 27, 28\]"),
        ({"images": IMAGES / 255, "labels": LABELS}, r"images is float64\[3, 28, 28\]"),
        ({"images": IMAGES[:0], "labels": LABELS[:0]}, r"images is uint8\[0, 28, 28\]"),
        ({"images": IMAGES, "labels": LABELS[1:]}, r"labels is uint8\[2\] beside 3 images"),
        ({"images": IMAGES, "labels": LABELS.astype(np.int64)}, r"labels is int64\[3\]"),
        ({"images": IMAGES, "labels": LABELS + 1}, "labels holds 10"),
        ({"images": IMAGES.astype(object), "labels": LABELS}, "not an npz file of plain arrays"),
    ],
)
def test_load_digits_refuses_other_arrays_by_name(tmp_path, arrays, problem):
    file = tmp_path / "digits.npz"
    np.savez(file, **arrays)
    with pytest.raises(FileError, match=problem) as caught:
        mnist.load_digits(file)
    assert caught.value.path == file
    assert "npz file with the arrays images" in caught.value.remedy


def broken_files():
    npy = (
        b"\x93NUMPY\x01\x00v\x00{'descr': '|u1', 'fortran_order': False, 'shape': (3,), }".ljust(127)
        + b"\nabc"
    )
    return {"empty": b"", "text": b"digits", "array": npy, "zip": b"PK\x03\x04" + bytes(50)}


@pytest.mark.parametrize("content", [pytest.param(data, id=name) for name, data in broken_files().items()])
def test_load_digits_refuses_a_file_of_another_kind(tmp_path, content):
    file = tmp_path / "digits.npz"
    file.write_bytes(content)
    with pytest.raises(FileError, match=r"digits\.npz: is not an npz file of plain arrays"):
        mnist.load_digits(file)


def test_load_digits_refuses_a_damaged_archive(tmp_path):
    file = tmp_path / "digits.npz"
    np.savez_compressed(file, images=IMAGES, labels=LABELS)
    content = bytearray(file.read_bytes())
    content[60:200] = bytes(140)
    file.write_bytes(content)
    with pytest.raises(FileError, match=r"digits\.npz: is not an npz file of plain arrays"):
        mnist.load_digits(file)


def test_load_digits_does_not_unpack_gigabytes(tmp_path, monkeypatch):
    monkeypatch.setattr(mnist, "_LIMIT_BYTES", 1_000_000)
    np.savez_compressed(tmp_path / "bomb.npz", images=np.zeros((3000, 28, 28), np.uint8), labels=LABELS)
    with pytest.raises(FileError, match=r"bomb\.npz: unpacks to 2 MB"):
        mnist.load_digits(tmp_path / "bomb.npz")


def test_load_digits_names_a_missing_file(tmp_path):
    with pytest.raises(FileError, match=r"lost\.npz: cannot be read: No such file"):
        mnist.load_digits(tmp_path / "lost.npz")


# --- inputs of the clients ---


@pytest.mark.parametrize("make", [inputs.angles, inputs.images, inputs.numbers])
def test_the_inputs_follow_from_the_seed(make):
    first, again, other = (make(np.random.default_rng(seed), 3) for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)
    assert not np.array_equal(first[0], first[1])


def test_the_angles_are_valid_requests_within_ten_degrees():
    words = inputs.angles(np.random.default_rng(7), 500)
    assert words.dtype == np.uint32
    requests = np.array([unpack(int(word)) for word in words])
    assert set(requests[:, 0].tolist()) == set(range(6))
    assert np.abs(requests[:, 1:]).max() <= 2560
    assert np.abs(requests[:, 1:]).max(axis=0).min() > 2400


def test_the_images_and_numbers_have_the_shapes_that_the_kernels_take():
    rng = np.random.default_rng(7)
    frames = inputs.images(rng, 2)
    assert frames.dtype == np.uint8
    assert frames.shape == (2, 480, 640, 3)
    assert sobel(frames[1]).max() > 50  # there are edges to find
    assert np.abs(frames[1].astype(int) - frames[0]).max() > 2 * inputs.NOISE  # the discs have moved
    numbers = inputs.numbers(rng, 2)
    assert numbers.dtype == np.uint32
    assert numbers.shape == (2, 2048)
    assert numbers.max() > 2**32 * 0.99
