// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/igtl/igtl_poses.h: samples from messages that incise/igtl.h packs, with times of
 * the test's own.
 */
#include "../unit.h"
#include "../../../lib/device/igtl/igtl_poses.h"

#define SECOND 1000000000LL
#define UTC0 (1790000000 * SECOND)

static const struct incise_tracker_setup setup = {.repeat_ms = 100};
static struct igtl_poses poses;
static double m[3][4], q[4];

static int begin(void **state)
{
	return igtl_poses_init(&poses, &setup, "Tip");
}

static int end(void **state)
{
	igtl_poses_free(&poses);
	return 0;
}

/* A turn by @angle about (1, 2, 3) / √14, and its quaternion, after Rodrigues. */
static void turn(double angle, double matrix[3][4], double q[4])
{
	double axis[3] = {1 / sqrt(14), 2 / sqrt(14), 3 / sqrt(14)};
	double s = sin(angle), c = cos(angle);

	for (int i = 0; i < 3; i++)
		for (int j = 0; j < 3; j++) {
			double cross = i == j		      ? 0
				       : (j - i + 3) % 3 == 1 ? -axis[3 - i - j]
							      : axis[3 - i - j];

			matrix[i][j] =
				c * (i == j) + s * cross + (1 - c) * axis[i] * axis[j];
		}
	q[0] = cos(angle / 2);
	for (int i = 0; i < 3; i++) {
		q[i + 1] = sin(angle / 2) * axis[i];
		matrix[i][3] = 10 * i + angle;
	}
}

static int put(const char *name, const double matrix[3][4], int64_t utc_ns, int64_t t_ns,
	       bool damage)
{
	struct incise_igtl_label label = {.version = 1, .name = name, .utc_ns = utc_ns};
	uint8_t bytes[200];
	ssize_t n = incise_igtl_pack_transform(bytes, sizeof(bytes), &label, matrix);

	assert_true(n > 0);
	bytes[n - 1] ^= damage;
	/* In two parts, as a network may cut it. */
	assert_int_equal(igtl_poses_put(&poses, bytes, 70, t_ns - 1000), 0);
	return igtl_poses_put(&poses, bytes + 70, (size_t)n - 70, t_ns);
}

static struct incise_tracker_sample taken(void)
{
	struct incise_tracker_sample sample;

	assert_int_equal(incise_ring_take(&poses.ring, &sample, 1), 1);
	return sample;
}

TEST(a_rotation_becomes_its_quaternion, begin, end)
{
	for (int i = 0; i < 100; i++) {
		struct incise_tracker_sample s;
		double dot = 0;

		turn(i * 0.13 - 6, m, q);
		assert_int_equal(put("Other", m, 0, (i + 1) * SECOND - 5, false), 0);
		assert_int_equal(put("Tip", m, 0, (i + 1) * SECOND, false), 0);
		s = taken();
		assert_int_equal(s.status, ' ');
		for (int k = 0; k < 4; k++)
			dot += s.quaternion[k] * q[k];
		/* Singles on the wire: 6e-8 in each element; the sign of a quaternion is free. */
		assert_true(fabs(fabs(dot) - 1) < 1e-6);
		for (int k = 0; k < 3; k++)
			assert_true(fabs(s.position_mm[k] - m[k][3]) < 1e-5);
		assert_int_equal(s.t_ns, (i + 1) * SECOND);
	}
	assert_int_equal(poses.n_names, 2);
}

TEST(what_is_no_pose_is_flagged)
{
	static const struct {
		double factor[3]; /* of the columns */
		double x;
		char status;
	} cases[] = {
		{{1, 1, 1}, 0, ' '},	{{1, 1, -1}, 0, '~'},
		{{0, 0, 0}, 0, '~'},	{{1.01, 1, 1}, 0, '~'},
		{{1, 1, 1}, NAN, '~'},	{{1, 1, 1}, INFINITY, '~'},
		{{1, 1, NAN}, 0, '~'},	{{1, 1, 1}, 2e6, '~'},
		{{1e30, 1, 1}, 0, '~'}, {{1.0005, 1, 1}, 0, ' '},
	};

	assert_int_equal(igtl_poses_init(&poses, &setup, ""), 0);
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_tracker_sample s;
		double m[3][4], q[4], length = 0;

		turn((double)i, m, q);
		for (int c = 0; c < 3; c++)
			for (int r = 0; r < 3; r++)
				m[r][c] *= cases[i].factor[c];
		m[0][3] += cases[i].x;
		assert_int_equal(put("Tip", m, 0, (int64_t)(i + 1) * SECOND, false), 0);
		s = taken();
		assert_int_equal(s.status, cases[i].status);
		assert_int_equal(incise_pose_usable(s.status), cases[i].status == ' ');
		for (int k = 0; k < 4; k++)
			length += s.quaternion[k] * s.quaternion[k];
		assert_true(fabs(length - 1) < 1e-12);
		for (int k = 0; k < 3; k++)
			assert_true(fabs(s.position_mm[k]) <= 1e6);
	}
	igtl_poses_free(&poses);
}

/* Arrivals up to 20 ms late of timestamps of a wall clock that is off, runs fast and is set. */
TEST(timestamps_lead_to_times_here, begin, end)
{
	int64_t last_ns = 0;

	srand(1);
	for (int i = 0; i < 5000; i++) {
		int64_t true_ns = 100 * SECOND + i * SECOND / 100;
		/* 50 ppm fast; set back by 3 s and ahead by 3 s. */
		int64_t utc_ns = UTC0 + true_ns + true_ns / 20000 -
				 (i >= 2000 && i < 4000 ? 3 * SECOND : 0);
		int64_t late_ns = (int64_t)(rand() / (double)RAND_MAX * 20e6) + 300000;
		struct incise_tracker_sample s;

		turn(i * 0.01, m, q);
		assert_int_equal(put("Tip", m, utc_ns, true_ns + late_ns, false), 0);
		/* The same pose sent again is not another. */
		assert_int_equal(put("Tip", m, utc_ns, true_ns + late_ns + 9, false), 0);
		s = taken();
		assert_int_equal(incise_ring_take(&poses.ring, &s, 1), 0);
		assert_true(s.t_ns > last_ns && s.t_ns <= true_ns + late_ns + 1);
		/* The arrival is kept; a pose that was put after the one before may be later. */
		assert_true(s.t_ns + s.after_ns == true_ns + late_ns ||
			    (!s.after_ns && s.t_ns > true_ns + late_ns));
		/*
		 * The least of 500 delays of 20 ms, 0.3 ms and 40 µs on average, and 50 ppm of
		 * 10 s; none of them is known within the first second after a clock was set.
		 */
		if (i % 2000 > 100)
			assert_true(llabs(s.t_ns - true_ns) < 2500000);
		last_ns = s.t_ns;
	}
}

/* Other poses with an equal timestamp are other poses, of a clock with coarse steps: 1 s, 0.1 s, none. */
TEST(coarse_timestamps_lose_no_pose, begin, end)
{
	static const int64_t steps_ns[] = {SECOND, SECOND / 10, 1000 * SECOND};

	for (size_t k = 0; k < 3; k++) {
		struct incise_tracker_sample s = {0};
		int n = 0;

		for (int i = 0; i < 240; i++) {
			int64_t t_ns = 100 * SECOND + i * SECOND / 60;
			int64_t utc_ns = UTC0 + t_ns / steps_ns[k] * steps_ns[k];

			turn(i * 0.01, m, q);
			assert_int_equal(put("Tip", m, utc_ns, t_ns, false), 0);
			/* sent again: the same pose at the same time */
			assert_int_equal(put("Tip", m, utc_ns, t_ns + 9, false), 0);
			for (; incise_ring_take(&poses.ring, &s, 1) == 1; n++)
				assert_true(i < 30 || llabs(s.t_ns - t_ns) < 10);
		}
		assert_int_equal(n, 240);
		assert_true(poses.coarse);
		igtl_poses_free(&poses);
		begin(NULL);
	}
}

/* Two senders of one name are seen; a tool that moves as fast as one can is not two. */
TEST(two_senders_are_seen, begin, end)
{
	for (int two = 0; two < 2; two++) {
		for (int i = 0; i < 60; i++) {
			int64_t t_ns = 100 * SECOND + i * SECOND / 60;

			turn(0, m, q);
			m[0][3] = two && i % 2 ? 499 + 0.1 * i : 80 * sin(0.8 * i * !two);
			assert_int_equal(put("Tip", m, UTC0 + t_ns, t_ns, false), 0);
		}
		assert_int_equal(igtl_poses_alternate(&poses), two);
		igtl_poses_free(&poses);
		begin(NULL);
	}
}

TEST(losses_are_counted, begin, end)
{
	struct incise_tracker_sample s = {0};

	for (int i = 0; i < 1000; i++) {
		int64_t t_ns = SECOND + i * SECOND / 100;

		turn(i * 0.01, m, q);
		if (i == 60) {
			assert_true(fabs(igtl_poses_hz(&poses) - 100) < 1e-6);
			igtl_poses_start(&poses, 100);
		}
		/* Three are missing, one is damaged: its time shows the same one, once. */
		if (i >= 400 && i < 403)
			continue;
		assert_int_equal(put("Tip", m, UTC0 + t_ns, t_ns + 1000, i == 700), 0);
	}
	while (incise_ring_take(&poses.ring, &s, 1) == 1)
		;
	assert_int_equal(atomic_load(&poses.lost), 4);
	assert_int_equal(s.seq, 999 - 60);
}

TEST(what_is_unseen_or_stuck_is_flagged, begin, end)
{
	static const struct incise_igtl_pair gone = {"ToolStatus", "OUT_OF_VIEW", 10, 3,
						     11};
	struct incise_igtl_label label = {
		.version = 2, .name = "Tip", .metadata = &gone, .n_metadata = 1};
	struct incise_igtl_status status = {.code = INCISE_IGTL_NOT_PRESENT, .text = ""};
	float body[12] = {0};
	uint8_t bytes[300];
	ssize_t n;

	turn(1, m, q);
	for (int i = 1; i <= 20; i++) {
		assert_int_equal(put("Tip", m, 0, i * SECOND / 50, false), 0);
		/* A pose that came for 100 ms, and comes again. */
		assert_int_equal(taken().status, i > 6 ? '=' : ' ');
	}
	turn(2, m, q);
	n = incise_igtl_pack_status(bytes, sizeof(bytes), &label, &status);
	assert_true(n > 0 && !igtl_poses_put(&poses, bytes, (size_t)n, SECOND));
	assert_int_equal(put("Tip", m, 0, SECOND, false), 0);
	assert_int_equal(taken().status, '!');
	status.code = INCISE_IGTL_OK;
	n = incise_igtl_pack_status(bytes, sizeof(bytes), &label, &status);
	assert_true(n > 0 && !igtl_poses_put(&poses, bytes, (size_t)n, SECOND));
	assert_int_equal(put("Tip", m, 0, SECOND + 1, false), 0);
	assert_int_equal(taken().status, ' ');
	/* As metadata, with a pose of zeros behind it. */
	n = incise_igtl_pack(bytes, sizeof(bytes), &label, "TRANSFORM", body,
			     sizeof(body));
	assert_true(n > 0 && !igtl_poses_put(&poses, bytes, (size_t)n, 2 * SECOND));
	assert_int_equal(taken().status, '!');
	/* Bytes that are not OpenIGTLink end it, until there is another connection. */
	memset(bytes, 0xff, sizeof(bytes));
	assert_int_equal(igtl_poses_put(&poses, bytes, sizeof(bytes), 3 * SECOND),
			 -EPROTO);
	assert_int_equal(igtl_poses_reconnected(&poses), 0);
	turn(3, m, q);
	assert_int_equal(put("Tip", m, 0, 4 * SECOND, false), 0);
	assert_true(taken().restarted);
}
