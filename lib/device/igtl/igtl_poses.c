// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Samples from the bytes of an OpenIGTLink server; see igtl_poses.h.
 */
#include <endian.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>
#include <openigtlink/igtl_position.h>
#include <openigtlink/igtl_tdata.h>
#include <openigtlink/igtl_transform.h>
#include "../../base/vector.h"
#include "igtl_poses.h"

#define BODY_MAX 65536 /* of a TDATA of 900 instruments; images are passed over */
#define CAPACITY 4096  /* of the ring: 4 s at 1 kHz */
#define ALTERNATE_MM 5 /* a step that a tool makes at hardly any pose */
#define LIMIT_MM 1e6
/* Limit of products of columns: a sender may print three digits; a scale of 1 % is an error. */
#define ORTHONORMAL 2e-3
#define POSES_LEAST 5
#define SLIP 2 /* periods */

#define UNSEEN '!'
#define INVALID '~'

int igtl_poses_init(struct igtl_poses *poses, const struct incise_tracker_setup *setup,
		    const char *device)
{
	*poses = (struct igtl_poses){.setup = *setup};
	snprintf(poses->device, sizeof(poses->device), "%s", device);
	poses->stream = incise_igtl_stream_new(BODY_MAX);
	return poses->stream
		       ? incise_ring_init(&poses->ring,
					  sizeof(struct incise_tracker_sample), CAPACITY)
		       : -ENOMEM;
}

void igtl_poses_free(struct igtl_poses *poses)
{
	incise_igtl_stream_free(poses->stream);
	incise_ring_free(&poses->ring);
	poses->stream = NULL;
}

double igtl_poses_hz(const struct igtl_poses *poses)
{
	double span_s = (double)(poses->last_ns - poses->first_ns) * 1e-9;

	if (poses->n < POSES_LEAST || (!*poses->device && poses->n_names != 1))
		return 0;
	return span_s > 0 ? (double)(poses->n - 1) / span_s : 0;
}

void igtl_poses_start(struct igtl_poses *poses, double rate_hz)
{
	struct incise_tracker_sample sample;

	while (incise_ring_take(&poses->ring, &sample, 1) == 1)
		;
	incise_pace_init(&poses->pace, rate_hz, INCISE_PACE_OFF, 1);
	/* Others that begin to send later are not taken for it. */
	if (!*poses->device && poses->n_names)
		memcpy(poses->device, poses->names[0], sizeof(poses->device));
	poses->counts = true;
	poses->seq = 0;
	atomic_store(&poses->lost, 0);
}

int igtl_poses_reconnected(struct igtl_poses *poses)
{
	struct incise_igtl_stream *stream = incise_igtl_stream_new(BODY_MAX);

	if (!stream)
		return -ENOMEM;
	incise_igtl_stream_free(poses->stream);
	poses->stream = stream;
	incise_pace_broken(&poses->pace);
	poses->restarted = poses->n;
	poses->refused = false;
	poses->clock = (struct incise_sender_clock){0};
	poses->stamp_ns = 0;
	return 0;
}

/* --- time --- */

static void lose(struct igtl_poses *poses, uint64_t n)
{
	poses->seq += n;
	atomic_fetch_add_explicit(&poses->lost, n, memory_order_relaxed);
}

/* --- poses --- */

/*
 * A rotation matrix as a unit quaternion, by the largest of its four squares, after Shepperd,
 * J. Guidance and Control 1(3), 1978. False: it is no rotation.
 */
static bool quaternion_of(const double m[3][4], double q[4])
{
	static const int next[3] = {1, 2, 0};
	double trace = m[0][0] + m[1][1] + m[2][2], across[3], root, length = 0;
	double column[3][3];
	int i = 0, j, k;

	for (int c = 0; c < 3; c++)
		for (int r = 0; r < 3; r++)
			column[c][r] = m[r][c];
	for (int a = 0; a < 3; a++)
		for (int b = a; b < 3; b++)
			if (!(fabs(v3_dot(column[a], column[b]) - (a == b)) <=
			      ORTHONORMAL))
				return false;
	/* A mirror is orthonormal, too. */
	v3_cross(across, column[0], column[1]);
	if (!(v3_dot(across, column[2]) > 0))
		return false;
	for (int r = 1; r < 3; r++)
		if (m[r][r] > m[i][i])
			i = r;
	if (trace >= m[i][i]) {
		root = sqrt(fmax(0, 1 + trace));
		q[0] = root / 2;
		for (int r = 0; r < 3; r++)
			q[r + 1] = (m[(r + 2) % 3][(r + 1) % 3] -
				    m[(r + 1) % 3][(r + 2) % 3]) /
				   (2 * root);
	} else {
		j = next[i];
		k = next[j];
		root = sqrt(fmax(0, 1 + m[i][i] - m[j][j] - m[k][k]));
		q[0] = (m[k][j] - m[j][k]) / (2 * root);
		q[i + 1] = root / 2;
		q[j + 1] = (m[j][i] + m[i][j]) / (2 * root);
		q[k + 1] = (m[k][i] + m[i][k]) / (2 * root);
	}
	for (int r = 0; r < 4; r++)
		length += q[r] * q[r];
	for (int r = 0; r < 4; r++)
		q[r] /= sqrt(length);
	return true;
}

static void note_pose(struct igtl_poses *poses, const double (*matrix)[4])
{
	double *before = poses->before_mm[0], *before2 = poses->before_mm[1];
	double step2 = 0, step = 0;

	for (int i = 0; i < 3; i++) {
		step += pow(matrix[i][3] - before[i], 2);
		step2 += pow(matrix[i][3] - before2[i], 2);
		before2[i] = before[i];
		before[i] = matrix[i][3];
	}
	if (poses->n >= 2) {
		poses->step_mm += sqrt(step);
		poses->step2_mm += sqrt(step2);
	}
	memcpy(poses->matrix, matrix, sizeof(poses->matrix));
}

bool igtl_poses_alternate(const struct igtl_poses *poses)
{
	return poses->n > 10 && poses->step_mm > ALTERNATE_MM * (double)poses->n &&
	       poses->step2_mm < poses->step_mm / 5;
}

/* @matrix NULL: it is not finite. @seen: the sender does not flag it. */
static void take_igtl_poses(struct igtl_poses *poses, const double (*matrix)[4],
			    bool seen, int64_t stamp_ns, int64_t t_ns)
{
	struct incise_tracker_sample sample = {
		.t_ns = t_ns, .status = INVALID, .station = 1, .quaternion = {1}};
	double offset[3];
	uint64_t missing = 0;

	/* The same pose with the same timestamp is sent again; another one has a clock of coarse steps. */
	if (stamp_ns && stamp_ns == poses->stamp_ns) {
		if (!matrix || !memcmp(matrix, poses->matrix, sizeof(poses->matrix)))
			return;
		poses->coarse = true;
	}
	if (matrix)
		note_pose(poses, matrix);
	if (stamp_ns && !poses->coarse)
		sample.t_ns = incise_sender_time(&poses->clock, stamp_ns, t_ns);
	poses->stamp_ns = stamp_ns;
	if (poses->n && sample.t_ns <= poses->last_ns)
		sample.t_ns = poses->last_ns + 1;
	if (matrix && quaternion_of(matrix, sample.quaternion)) {
		sample.status = tracker_repeats(&poses->repeat, matrix[0], 12,
						sample.t_ns, poses->setup.repeat_ms)
					? '='
					: ' ';
		v3_rotate(offset, sample.quaternion, poses->setup.offset_mm);
		for (int i = 0; i < 3; i++)
			sample.position_mm[i] = matrix[i][3] + offset[i];
		for (int i = 0; i < 3; i++)
			if (!(fabs(sample.position_mm[i]) <= LIMIT_MM)) {
				memset(sample.position_mm, 0, sizeof(sample.position_mm));
				sample.status = INVALID;
			}
	}
	if (!seen)
		sample.status = UNSEEN;
	if (sample.t_ns < t_ns)
		sample.after_ns = (uint32_t)(t_ns - sample.t_ns);
	if (!poses->n++)
		poses->first_ns = sample.t_ns;
	poses->last_ns = sample.t_ns;
	if (poses->counts)
		missing = incise_pace_add(&poses->pace, sample.t_ns, t_ns);
	/* A program that sends by sleeping slips, and nothing is missing. */
	if (missing > SLIP)
		lose(poses, missing);
	atomic_store_explicit(&poses->unsure, poses->pace.unsure, memory_order_relaxed);
	sample.seq = poses->seq++;
	sample.restarted = poses->restarted;
	if (incise_ring_put(&poses->ring, &sample))
		poses->restarted = false;
	else
		atomic_fetch_add_explicit(&poses->lost, 1, memory_order_relaxed);
}

static bool is_ours(struct igtl_poses *poses, const char *name)
{
	bool known = false;

	for (int i = 0; i < poses->n_names; i++)
		known |= !strcmp(poses->names[i], name);
	if (!known && poses->n_names < IGTL_NAMES)
		snprintf(poses->names[poses->n_names++], sizeof(*poses->names), "%s",
			 name);
	return !*poses->device || !strcmp(poses->device, name);
}

/* --- bodies --- */

/* Each reader: 0; -EPROTO (another size), -EDOM (a value is not finite). */

/* On the wire by columns: three axes, then the translation. */
static int read_matrix(const void *from, double matrix[3][4])
{
	igtl_float32 column[12];

	memcpy(column, from, sizeof(column));
	igtl_transform_convert_byte_order(column);
	for (int i = 0; i < 12; i++) {
		matrix[i % 3][i / 3] = column[i];
		if (!isfinite(column[i]))
			return -EDOM;
	}
	return 0;
}

static int read_transform(const struct incise_igtl_message *message, double matrix[3][4])
{
	return message->n == IGTL_TRANSFORM_SIZE ? read_matrix(message->content, matrix)
						 : -EPROTO;
}

/* The rotation of a quaternion (x, y, z, w) of any length but 0. */
static int set_rotation(double matrix[3][4], const double q[4])
{
	double norm = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];

	/* Squares of floats are in the range of double. */
	if (!isfinite(norm) || !(norm > 0))
		return -EDOM;
	for (int i = 0; i < 3; i++) {
		int j = (i + 1) % 3, k = (i + 2) % 3;

		matrix[i][i] = 1 - 2 * (q[j] * q[j] + q[k] * q[k]) / norm;
		matrix[i][j] = 2 * (q[i] * q[j] - q[k] * q[3]) / norm;
		matrix[i][k] = 2 * (q[i] * q[k] + q[j] * q[3]) / norm;
	}
	return 0;
}

/* Without an orientation the rotation is the unit matrix; a quaternion is normalised. */
static int read_position(const struct incise_igtl_message *message, double matrix[3][4])
{
	igtl_position position = {.quaternion = {0}};
	double q[4] = {0, 0, 0, 1};

	if (message->n != IGTL_POSITION_MESSAGE_POSITON_ONLY_SIZE &&
	    message->n != IGTL_POSITION_MESSAGE_WITH_QUATERNION3_SIZE &&
	    message->n != IGTL_POSITION_MESSAGE_DEFAULT_SIZE)
		return -EPROTO;
	memcpy(&position, message->content, message->n);
	igtl_position_convert_byte_order(&position);
	for (int i = 0; i < 3; i++) {
		matrix[i][3] = position.position[i];
		if (!isfinite(matrix[i][3]))
			return -EDOM;
	}
	for (int i = 0; i < (int)message->n / 4 - 3; i++)
		q[i] = position.quaternion[i];
	/* A quaternion with three numbers is a unit by its w. */
	if (message->n == IGTL_POSITION_MESSAGE_WITH_QUATERNION3_SIZE)
		q[3] = sqrt(fmax(0, 1 - q[0] * q[0] - q[1] * q[1] - q[2] * q[2]));
	return set_rotation(matrix, q);
}

/* Element @i of a TDATA, and the name of its instrument. -ENOENT: there are fewer. */
static int read_tdata(const struct incise_igtl_message *message, size_t i, char *name,
		      double matrix[3][4])
{
	const igtl_tdata_element *element = (const void *)message->content;

	if (message->n % sizeof(*element))
		return -EPROTO;
	if (i >= message->n / sizeof(*element))
		return -ENOENT;
	incise_igtl_name(name, element[i].name, sizeof(element[i].name));
	return read_matrix(element[i].transform, matrix);
}

/* PLUS sends the state of a tool as metadata: "OK", or else. */
static bool is_seen(const struct incise_igtl_message *message)
{
	struct incise_igtl_pair pair;
	bool seen = true;

	for (int i = 0; !incise_igtl_metadata(message, i, &pair); i++)
		if (pair.key_n >= 6 &&
		    !strncasecmp(pair.key + pair.key_n - 6, "status", 6))
			seen &= pair.value_n == 2 && !strncasecmp(pair.value, "OK", 2);
	return seen;
}

static void take_message(struct igtl_poses *poses,
			 const struct incise_igtl_message *message, int64_t t_ns)
{
	struct incise_igtl_status status;
	char name[IGTL_HEADER_NAME_SIZE + 1];
	bool seen = !poses->refused && is_seen(message);
	double matrix[3][4];
	int rc = -EPROTO;

	poses->messages++;
	if (!strcmp(message->type, "STATUS")) {
		if (message->n < sizeof(status) ||
		    (*message->name && strcmp(message->name, poses->device)))
			return;
		memcpy(&status, message->content, sizeof(status));
		poses->refused = be16toh(status.code) != INCISE_IGTL_OK;
		return;
	}
	if (!strcmp(message->type, "TRANSFORM"))
		rc = read_transform(message, matrix);
	else if (!strcmp(message->type, "POSITION"))
		rc = read_position(message, matrix);
	if (rc != -EPROTO && is_ours(poses, message->name))
		take_igtl_poses(poses, rc ? NULL : (const double(*)[4])matrix, seen,
				message->utc_ns, t_ns);
	for (size_t i = 0; !strcmp(message->type, "TDATA"); i++) {
		rc = read_tdata(message, i, name, matrix);
		if (rc && rc != -EDOM)
			break;
		if (is_ours(poses, name))
			take_igtl_poses(poses, rc ? NULL : (const double(*)[4])matrix,
					seen, message->utc_ns, t_ns);
	}
}

int igtl_poses_put(struct igtl_poses *poses, const uint8_t *bytes, size_t n, int64_t t_ns)
{
	struct incise_igtl_message message;
	int found;

	while ((found = incise_igtl_stream_next(poses->stream, &bytes, &n, &message))) {
		if (found == -EPROTO)
			return found;
		if (found == 1) {
			take_message(poses, &message, t_ns);
		} else if (found == -EBADMSG && !poses->counts) {
			poses->damaged++;
		} else if (found == -EBADMSG) {
			/* A damaged message may have been a pose. */
			incise_pace_skip(&poses->pace, 1);
			lose(poses, 1);
		}
	}
	return 0;
}
