// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/igtl/igtl_poses.h: samples from messages whose bodies libopenigtlink orders, with times
 * of the test's own.
 */
#include <endian.h>
#include <openigtlink/igtl_position.h>
#include <openigtlink/igtl_tdata.h>
#include <openigtlink/igtl_transform.h>
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

/* The body of a TRANSFORM. */
static void order(igtl_float32 column[12], const double matrix[3][4])
{
	for (int i = 0; i < 12; i++)
		column[i] = (float)matrix[i % 3][i / 3];
	igtl_transform_convert_byte_order(column);
}

static void put_body(const struct incise_igtl_label *label, const void *body, size_t n,
		     int64_t t_ns)
{
	uint8_t bytes[300];
	ssize_t size = incise_igtl_pack(bytes, sizeof(bytes), label, body, n, NULL, 0);

	assert_true(size > 0 && !igtl_poses_put(&poses, bytes, (size_t)size, t_ns));
}

static int put(const char *name, const double matrix[3][4], int64_t utc_ns, int64_t t_ns,
	       bool damage)
{
	struct incise_igtl_label label = {
		.version = 1, .type = "TRANSFORM", .name = name, .utc_ns = utc_ns};
	igtl_float32 body[12];
	uint8_t bytes[200];
	ssize_t n;

	order(body, matrix);
	n = incise_igtl_pack(bytes, sizeof(bytes), &label, body, sizeof(body), NULL, 0);
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

/* A quarter of a turn about z, as elements of TDATA and as a POSITION of each size. */
TEST(trackers_of_other_messages_are_read, begin, end)
{
	static const double turned[3][4] = {{0, -1, 0, 1}, {1, 0, 0, 2}, {0, 0, 1, 3}};
	struct incise_igtl_label label = {
		.version = 1, .type = "TDATA", .name = "Tracker"};
	igtl_tdata_element element[2] = {{.name = "Probe", .type = IGTL_TDATA_TYPE_6D},
					 {.name = "Tip", .type = IGTL_TDATA_TYPE_6D}};
	struct incise_tracker_sample s;
	igtl_float32 column[12];

	order(column, turned);
	igtl_transform_convert_byte_order(column);
	memcpy(element[1].transform, column, sizeof(column));
	igtl_tdata_convert_byte_order(element, 2);
	put_body(&label, element, sizeof(element), SECOND);
	assert_int_equal(poses.n_names, 2);
	/* Half an element is none. */
	put_body(&label, element, sizeof(element) - 35, SECOND);
	label.type = "POSITION";
	label.name = "Tip";
	for (size_t n = 0; n <= 28; n += 4) {
		/* The length of a quaternion is free, but for one of three numbers. */
		float length = n == 28 ? 2 : 1;
		igtl_position position = {.position = {1, 2, 3},
					  .quaternion = {0, 0, length * (float)M_SQRT1_2,
							 length * (float)M_SQRT1_2}};

		igtl_position_convert_byte_order(&position);
		put_body(&label, &position, n, SECOND + (int64_t)n);
	}
	for (int i = 0; i < 4; i++) {
		s = taken();
		assert_int_equal(s.status, ' ');
		for (int k = 0; k < 3; k++)
			assert_true(s.position_mm[k] == k + 1);
		/* Singles on the wire. */
		assert_true(fabs(s.quaternion[0] - (i == 1 ? 1 : M_SQRT1_2)) < 1e-6);
		assert_true(fabs(s.quaternion[3] - (i == 1 ? 0 : M_SQRT1_2)) < 1e-6);
	}
	/* A quaternion of zeros. */
	put_body(&label, (const uint8_t[28]){0}, 28, 2 * SECOND);
	assert_int_equal(taken().status, '~');
	assert_int_equal(incise_ring_take(&poses.ring, &s, 1), 0);
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
	static const char *const gone[][2] = {{"ToolStatus", "OUT_OF_VIEW"}};
	struct incise_igtl_label label = {.version = 2,
					  .type = "STATUS",
					  .name = "Tip",
					  .metadata = gone,
					  .n_metadata = 1};
	struct incise_igtl_status status = {.code = htobe16(INCISE_IGTL_NOT_PRESENT)};
	uint8_t bytes[300];

	turn(1, m, q);
	for (int i = 1; i <= 20; i++) {
		assert_int_equal(put("Tip", m, 0, i * SECOND / 50, false), 0);
		/* A pose that came for 100 ms, and comes again. */
		assert_int_equal(taken().status, i > 6 ? '=' : ' ');
	}
	turn(2, m, q);
	put_body(&label, &status, sizeof(status), SECOND);
	assert_int_equal(put("Tip", m, 0, SECOND, false), 0);
	assert_int_equal(taken().status, '!');
	/* One that is too short says nothing. */
	put_body(&label, &(uint16_t){htobe16(INCISE_IGTL_OK)}, 2, SECOND);
	assert_int_equal(put("Tip", m, 0, SECOND, false), 0);
	assert_int_equal(taken().status, '!');
	status.code = htobe16(INCISE_IGTL_OK);
	put_body(&label, &status, sizeof(status), SECOND);
	assert_int_equal(put("Tip", m, 0, SECOND + 1, false), 0);
	assert_int_equal(taken().status, ' ');
	/* As metadata, with a pose of zeros behind it. */
	label.type = "TRANSFORM";
	put_body(&label, (const uint8_t[48]){0}, 48, 2 * SECOND);
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
