// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Messages of ROS 2 in CDR, with their definitions, as rosbag2 stores them; see messages.h. Lengths
 * are in metres, as everywhere in ROS, times are UTC.
 *
 *     00 01 00 00 │ fields, little-endian, each at a multiple of its size from here
 *
 * A text has its length with the NUL (4 bytes), its bytes, and the NUL.
 */
#include <endian.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include "../base/ros2.h"
#include "../base/utf8.h"
#include "../base/vector.h"
#include "interpolators.h"
#include "messages.h"

#define FRAME_CAMERA "camera"

/* --- CDR ----------------------------------------------------------------------------- */

/* Room of the fields of a message without its texts and data; incise_messages_reserve() has it. */
struct cdr {
	char *start, *at;
};

static struct cdr cdr_begin(struct incise_messages *messages)
{
	static const char header[4] = {0, 1, 0, 0};

	memcpy(messages->text, header, sizeof(header));
	return (struct cdr){messages->text + 4, messages->text + 4};
}

static int64_t cdr_end(const struct cdr *cdr, const struct incise_messages *messages)
{
	return cdr->at - messages->text;
}

static void put_align(struct cdr *cdr, size_t size)
{
	while ((size_t)(cdr->at - cdr->start) % size)
		*cdr->at++ = 0;
}

static void put_u8(struct cdr *cdr, uint8_t value)
{
	*cdr->at++ = (char)value;
}

static void put_u32(struct cdr *cdr, uint32_t value)
{
	uint32_t bytes = htole32(value);

	put_align(cdr, sizeof(bytes));
	memcpy(cdr->at, &bytes, sizeof(bytes));
	cdr->at += sizeof(bytes);
}

static void put_f64(struct cdr *cdr, double value)
{
	uint64_t bytes;

	memcpy(&bytes, &value, sizeof(bytes));
	bytes = htole64(bytes);
	put_align(cdr, sizeof(bytes));
	memcpy(cdr->at, &bytes, sizeof(bytes));
	cdr->at += sizeof(bytes);
}

static void put_data(struct cdr *cdr, const void *data, size_t n)
{
	put_u32(cdr, (uint32_t)n);
	memcpy(cdr->at, data, n);
	cdr->at += n;
}

static void put_messages_ros2_text(struct cdr *cdr, const char *text)
{
	put_u32(cdr, (uint32_t)strlen(text) + 1);
	cdr->at = utf8_copy_printable(cdr->at, text, "");
	*cdr->at++ = 0;
}

static void put_time(struct cdr *cdr, uint64_t ns)
{
	struct ros2_time time = ros2_time(ns);

	put_u32(cdr, (uint32_t)time.sec);
	put_u32(cdr, time.nanosec);
}

static struct cdr header_begin(struct incise_messages *messages,
			       const struct incise_stream_rows *stream, const char *frame)
{
	struct cdr cdr = cdr_begin(messages);

	put_time(&cdr, incise_message_ns(messages, stream->rows.t_ns));
	put_messages_ros2_text(&cdr, frame);
	return cdr;
}

/* --- messages ------------------------------------------------------------------------ */

static int64_t force_message(struct incise_messages *messages,
			     const struct incise_stream_rows *stream)
{
	struct cdr cdr = header_begin(messages, stream, ROS2_FRAME_SCALPEL);
	double wrench[6] = {0, 0, stream->cells[INCISE_CELL_FORCE].real};

	for (int i = 0; i < 6; i++)
		put_f64(&cdr, wrench[i]);
	return cdr_end(&cdr, messages);
}

/* Pose of the calibrated tip; a pose that the tracker flags as unusable has no message. */
static int64_t tracker_message(struct incise_messages *messages,
			       const struct incise_stream_rows *stream)
{
	struct cdr cdr = header_begin(messages, stream, ROS2_FRAME_TRACKER);
	const union incise_cell *cells = stream->cells;
	double q[4], position_mm[3], values[7];

	if (!incise_pose_usable(*cells[INCISE_CELL_STATUS].text))
		return 0;
	for (int i = 0; i < 4; i++)
		q[i] = cells[INCISE_CELL_QUATERNION + i].real;
	v3_rotate(position_mm, q, messages->recording->meta.tip_mm);
	for (int i = 0; i < 3; i++)
		position_mm[i] += cells[INCISE_CELL_POSITION + i].real;
	ros2_pose(values, position_mm, q);
	for (int i = 0; i < 7; i++)
		put_f64(&cdr, values[i]);
	return cdr_end(&cdr, messages);
}

static int64_t event_message(struct incise_messages *messages,
			     const struct incise_stream_rows *stream)
{
	struct cdr cdr = cdr_begin(messages);

	put_time(&cdr, incise_message_ns(messages, stream->rows.t_ns));
	put_u8(&cdr, ROS2_LOG_INFO);
	put_messages_ros2_text(&cdr, stream->cells[INCISE_CELL_KIND].text);
	put_messages_ros2_text(&cdr, stream->cells[INCISE_CELL_TEXT].text);
	put_messages_ros2_text(&cdr, "");
	put_messages_ros2_text(&cdr, "");
	put_u32(&cdr, 0);
	return cdr_end(&cdr, messages);
}

/* Read on to a frame. Returns whether it is there and undamaged, or -errno. */
static int find_frame(struct incise_messages *messages, uint64_t seq)
{
	struct incise_frames_stored stored;

	while (!messages->any_frame || messages->frame.seq < seq) {
		int rc = incise_frames_next(messages->frames, &messages->frame, &stored,
					    NULL);

		if (rc < 0 && rc != -EBADMSG)
			return rc;
		if (!rc)
			return 0;
		messages->any_frame = true;
	}
	return messages->frame.seq == seq && messages->frame.data;
}

static const char *encoding_of(enum incise_pixels pixels)
{
	switch (pixels) {
	case INCISE_PIXELS_RGB:
		return "rgb8";
	case INCISE_PIXELS_GREY:
		return "mono8";
	case INCISE_PIXELS_YUYV:
		return "yuv422_yuy2";
	default:
		return "jpeg";
	}
}

static int64_t frame_message(struct incise_messages *messages,
			     const struct incise_stream_rows *stream)
{
	const struct incise_camera_frame *frame = &messages->frame;
	int rc = find_frame(messages, (uint64_t)incise_rows_seq(&stream->rows));
	struct cdr cdr;

	if (rc <= 0)
		return rc;
	rc = incise_messages_reserve(messages, frame->size);
	if (rc)
		return rc;
	cdr = header_begin(messages, stream, FRAME_CAMERA);
	if (frame->pixels != INCISE_PIXELS_MJPEG) {
		put_u32(&cdr, (uint32_t)frame->height);
		put_u32(&cdr, (uint32_t)frame->width);
	}
	put_messages_ros2_text(&cdr, encoding_of(frame->pixels));
	if (frame->pixels != INCISE_PIXELS_MJPEG) {
		put_u8(&cdr, 0); /* big-endian: no */
		put_u32(&cdr, (uint32_t)frame->stride);
	}
	put_data(&cdr, frame->data, frame->size);
	return cdr_end(&cdr, messages);
}

/* --- topics -------------------------------------------------------------------------- */

/* Definitions of other messages follow each, behind a line of 80 '=', as rosbag2 writes them. */
#define MSG(name)                                                                          \
	"================================================================================" \
	"\nMSG: " name "\n"
#define HEADER                 \
	MSG("std_msgs/Header") \
	"builtin_interfaces/Time stamp\nstring frame_id\n" TIME
#define TIME MSG("builtin_interfaces/Time") "int32 sec\nuint32 nanosec\n"

static const struct incise_message_stream streams[] = {
	{"force", force_message, NULL, "/force", ROS2_WRENCH,
	 "std_msgs/Header header\nWrench wrench\n" /**/
	 MSG("geometry_msgs/Wrench") "Vector3 force\nVector3 torque\n" MSG(
		 "geometry_msgs/Vector3") "float64 x\nfloat64 y\nfloat64 z\n" HEADER},
	{"tracker", tracker_message, NULL, "/tip", ROS2_POSE,
	 "std_msgs/Header header\nPose pose\n" /**/
	 MSG("geometry_msgs/Pose") "Point position\nQuaternion orientation\n" MSG("geometry_msgs/Point") "float64 x\nfloat64 y\nfloat64 z\n" MSG(
		 "geometry_msgs/Quaternion") "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n" HEADER},
	{"events", event_message, NULL, "/events", ROS2_LOG,
	 "byte DEBUG=10\nbyte INFO=20\nbyte WARN=30\nbyte ERROR=40\nbyte FATAL=50\n"
	 "builtin_interfaces/Time stamp\nuint8 level\nstring name\nstring msg\n"
	 "string file\nstring function\nuint32 line\n" TIME},
	{"frames", frame_message, NULL, "/camera/image/compressed",
	 "sensor_msgs/msg/CompressedImage",
	 "std_msgs/Header header\nstring format\nuint8[] data\n" HEADER},
	{"frames", frame_message, NULL, "/camera/image", "sensor_msgs/msg/Image",
	 "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\n"
	 "uint8 is_bigendian\nuint32 step\nuint8[] data\n" HEADER},
};

enum { ALWAYS = 0x7, COMPRESSED = 1 << 3, RAW = 1 << 4 };

/* The camera's topic is that of its first undamaged frame. */
static int select_streams(struct incise_messages *messages, struct incise_error *err)
{
	const char *folder =
		messages->recording->streams[INCISE_LEDGER_CAMERA]->file->path;
	int rc = incise_camera_interpolator_any(messages->recording, err);
	char *path;

	if (rc <= 0)
		return rc < 0 ? rc : ALWAYS;
	if (asprintf(&path, "%s/%s", folder, INCISE_FRAMES_FILE) < 0)
		return incise_error_set(err, ENOMEM, "%s: out of memory", folder);
	messages->frames = incise_frames_reader_new(path, err);
	rc = messages->frames ? 0 : -errno;
	free(path);
	while (!rc && !messages->frame.data) {
		struct incise_frames_stored stored;

		rc = incise_frames_next(messages->frames, &messages->frame, &stored, err);
		if (!rc)
			return ALWAYS;
		rc = rc < 0 && rc != -EBADMSG ? rc : 0;
	}
	messages->any_frame = true;
	return rc					       ? rc
	       : messages->frame.pixels == INCISE_PIXELS_MJPEG ? ALWAYS | COMPRESSED
							       : ALWAYS | RAW;
}

/* The metadata of `ros2 bag info`, in YAML on one line; version 5 is that of the oldest readers. */
static int add_metadata(struct incise_messages *messages)
{
	struct incise_mcap *mcap = &messages->mcap;
	struct incise_provenance pairs = {0};
	uint64_t n = 0;
	char *topics = NULL;
	size_t size;
	FILE *out = open_memstream(&topics, &size);

	if (!out)
		return -ENOMEM;
	for (int i = 0; i < mcap->n_channels; i++) {
		const struct incise_mcap_channel *channel = &mcap->channels[i];

		n += channel->messages;
		fprintf(out,
			"%s{topic_metadata: {name: %s, type: %s, serialization_format: "
			"%s, offered_qos_profiles: \"%s\"}, message_count: %llu}",
			i ? ", " : "", channel->topic, channel->schema_name,
			channel->encoding, channel->qos,
			(unsigned long long)channel->messages);
	}
	if (fclose(out)) {
		free(topics);
		return -ENOMEM;
	}
	incise_provenance_add(
		&pairs, "serialized_metadata",
		"{version: 5, storage_identifier: mcap, duration: {nanoseconds: "
		"%llu}, starting_time: {nanoseconds_since_epoch: %llu}, "
		"message_count: %llu, topics_with_message_count: [%s], "
		"compression_format: \"\", compression_mode: \"\", "
		"relative_file_paths: [], files: []}",
		(unsigned long long)(mcap->last_ns - mcap->first_ns),
		(unsigned long long)mcap->first_ns, (unsigned long long)n, topics);
	free(topics);
	return incise_messages_pairs(messages, "rosbag2", &pairs);
}

const struct incise_message_profile incise_messages_ros2 = {
	.name = "ros2",
	.encoding = "cdr",
	.schema_encoding = "ros2msg",
	.qos = "[]",
	.streams = streams,
	.n = sizeof(streams) / sizeof(*streams),
	.wall = true,
	.select = select_streams,
	.finish = add_metadata,
};
