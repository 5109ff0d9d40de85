// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Reading camera.mkv; see ../record/frames.h. From the front to the end, wherever that is:
 * no index, no length is asked for.
 *
 * A file is data from outside: sizes are checked before anything is made of them, and a
 * picture whose bytes are not those of its CRC is not decoded.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include "mkv.h"
#include "planes.h"

#define NS_PER_MS 1000000

struct reader {
	struct incise_frames_reader reader;
	char *path;
	AVFormatContext *format; /* NULL: there is no picture */
	AVCodecContext *codec;	 /* NULL: MJPEG */
	AVFrame *planes;
	AVPacket *packet;
	uint8_t *data;
	size_t room;
	uint64_t next_seq; /* where a file of others has none */
};

static struct reader *of(struct incise_frames_reader *reader)
{
	return (struct reader *)reader;
}

/* What was written beside it, or what can be told without. */
static bool read_note(struct reader *r, struct mkv_note *note)
{
	size_t size = 0;
	const uint8_t *side = av_packet_get_side_data(
		r->packet, AV_PKT_DATA_MATROSKA_BLOCKADDITIONAL, &size);

	if (side && size > 8 && mkv_note_read(note, side + 8, size - 8))
		return true;
	*note = (struct mkv_note){
		.seq = r->next_seq,
		.t_ns = r->packet->pts > INT64_MIN / NS_PER_MS &&
					r->packet->pts < INT64_MAX / NS_PER_MS
				? r->packet->pts * NS_PER_MS
				: 0,
	};
	return false;
}

static int bad(struct reader *r, const struct mkv_note *note, const char *why,
	       struct incise_error *err)
{
	return incise_error_set(err, EBADMSG, "%.300s: picture %llu: %s", r->path,
				(unsigned long long)note->seq, why);
}

static bool pixels_of(int format, enum incise_pixels *pixels)
{
	for (int i = INCISE_PIXELS_RGB; i < INCISE_PIXELS_MJPEG; i++)
		if ((int)planes_format((enum incise_pixels)i) == format) {
			*pixels = (enum incise_pixels)i;
			return true;
		}
	return false;
}

static bool is_size(int width, int height)
{
	return width >= INCISE_FRAMES_SIDE_MIN && width <= INCISE_FRAMES_SIDE_MAX &&
	       height >= INCISE_FRAMES_SIDE_MIN && height <= INCISE_FRAMES_SIDE_MAX;
}

/* FFV1 to the camera's pixels. 0, -EBADMSG (nothing is said yet), -ENOMEM. */
static int decode(struct reader *r, struct incise_camera_frame *frame)
{
	size_t row, size;
	int rc = avcodec_send_packet(r->codec, r->packet);

	if (!rc)
		rc = avcodec_receive_frame(r->codec, r->planes);
	if (rc)
		return rc == AVERROR(ENOMEM) ? -ENOMEM : -EBADMSG;
	if (!pixels_of(r->planes->format, &frame->pixels) ||
	    !is_size(r->planes->width, r->planes->height) ||
	    (frame->pixels == INCISE_PIXELS_YUYV && r->planes->width % 2))
		return -EBADMSG;
	row = incise_frames_row(frame->pixels, r->planes->width);
	size = row * (size_t)r->planes->height;
	if (size > r->room) {
		uint8_t *larger = realloc(r->data, size);

		if (!larger)
			return -ENOMEM;
		r->data = larger;
		r->room = size;
	}
	planes_to(r->planes, frame->pixels, r->data);
	frame->width = r->planes->width;
	frame->height = r->planes->height;
	frame->stride = (int)row;
	frame->data = r->data;
	frame->size = size;
	return 0;
}

/* A file that was killed before its first cluster, which libavformat does not open. */
static bool is_unbegun(const char *path)
{
	static const uint8_t magic[4] = {0x1a, 0x45, 0xdf, 0xa3};
	static const uint8_t cluster[4] = {0x1f, 0x43, 0xb6, 0x75};
	uint8_t head[4096], *found;
	FILE *file = fopen(path, "rbe");
	size_t n;

	if (!file)
		return false;
	n = fread(head, 1, sizeof(head), file);
	fclose(file);
	if (n == sizeof(head) || memcmp(head, magic, n < 4 ? n : 4))
		return false;
	found = memmem(head, n, cluster, sizeof(cluster));
	/* Or in the length of the first one. */
	return !found || found + 12 > head + n;
}

static int reader_next(struct incise_frames_reader *reader,
		       struct incise_camera_frame *frame,
		       struct incise_frames_stored *stored, struct incise_error *err)
{
	struct reader *r = of(reader);
	const AVCodecParameters *codec;
	struct mkv_note note;
	bool noted;
	int rc;

	if (!r->format)
		return 0;
	codec = r->format->streams[0]->codecpar;
	do {
		av_packet_unref(r->packet);
		rc = av_read_frame(r->format, r->packet);
	} while (!rc && r->packet->stream_index);
	if (rc == AVERROR(ENOMEM) || rc == AVERROR(EIO))
		return incise_error_set(err, AVUNERROR(rc), "%.300s: cannot be read: %s",
					r->path, strerror(AVUNERROR(rc)));
	/* A cluster that was cut off is the end like any other. */
	if (rc < 0)
		return 0;
	/* FFV1 is in Matroska in the way of AVI until ffmpeg 7, where times are dts. */
	if (r->packet->pts == AV_NOPTS_VALUE)
		r->packet->pts = r->packet->dts;
	noted = read_note(r, &note);
	r->next_seq = note.seq + 1;
	*frame = (struct incise_camera_frame){
		.t_ns = note.t_ns,
		.seq = note.seq,
		.width = codec->width,
		.height = codec->height,
		.pixels = INCISE_PIXELS_MJPEG,
	};
	*stored = (struct incise_frames_stored){
		.pts_ms = r->packet->pts,
		.bytes = (uint32_t)r->packet->size,
		.crc = mkv_crc(r->packet->data, (size_t)r->packet->size),
	};
	if (!r->packet->size || (noted && stored->crc != note.crc))
		return bad(r, &note, "its bytes are not those that were recorded", err);
	if (!r->codec) {
		frame->data = r->packet->data;
		frame->size = (size_t)r->packet->size;
		return 1;
	}
	if (reader->undecoded)
		return 1;
	rc = decode(r, frame);
	if (rc == -ENOMEM)
		return incise_error_set(err, ENOMEM, "%.300s: out of memory", r->path);
	return rc ? bad(r, &note, "cannot be decoded", err) : 1;
}

static void reader_close(struct incise_frames_reader *reader)
{
	struct reader *r = of(reader);

	avcodec_free_context(&r->codec);
	av_frame_free(&r->planes);
	av_packet_free(&r->packet);
	avformat_close_input(&r->format);
	free(r->data);
	free(r->path);
	free(r);
}

static int open_codec(struct reader *r, const AVCodecParameters *parameters)
{
	const AVCodec *codec = avcodec_find_decoder(parameters->codec_id);
	int rc;

	if (!codec)
		return AVERROR(ENOSYS);
	r->codec = avcodec_alloc_context3(codec);
	r->planes = av_frame_alloc();
	if (!r->codec || !r->planes)
		return AVERROR(ENOMEM);
	rc = avcodec_parameters_to_context(r->codec, parameters);
	if (rc < 0)
		return rc;
	r->codec->thread_count = 1;
	r->codec->err_recognition = AV_EF_CRCCHECK | AV_EF_EXPLODE;
	r->codec->max_pixels = (int64_t)INCISE_FRAMES_SIDE_MAX * INCISE_FRAMES_SIDE_MAX;
	return avcodec_open2(r->codec, codec, NULL);
}

/* 0, or a code of libav. */
static int begin(struct reader *r)
{
	const AVCodecParameters *codec;
	AVDictionary *options = NULL;
	char *url = NULL;
	int rc;

	/* A name with a colon is no protocol. */
	if (asprintf(&url, "file:%s", r->path) < 0)
		return AVERROR(ENOMEM);
	av_dict_set(&options, "protocol_whitelist", "file", 0);
	rc = avformat_open_input(&r->format, url, av_find_input_format("matroska"),
				 &options);
	av_dict_free(&options);
	free(url);
	if (rc < 0 && rc != AVERROR(ENOMEM) && is_unbegun(r->path))
		return 0;
	if (rc < 0)
		return rc;
	r->format->flags |= AVFMT_FLAG_NOPARSE | AVFMT_FLAG_NOFILLIN;
	r->packet = av_packet_alloc();
	if (!r->packet)
		return AVERROR(ENOMEM);
	if (!r->format->nb_streams)
		return AVERROR_INVALIDDATA;
	codec = r->format->streams[0]->codecpar;
	if (codec->codec_type != AVMEDIA_TYPE_VIDEO ||
	    !is_size(codec->width, codec->height))
		return AVERROR_INVALIDDATA;
	if (codec->codec_id == AV_CODEC_ID_MJPEG)
		return 0;
	return codec->codec_id == AV_CODEC_ID_FFV1 ? open_codec(r, codec)
						   : AVERROR_INVALIDDATA;
}

struct incise_frames_reader *mkv_reader_new(const char *path, struct incise_error *err)
{
	static const struct incise_frames_reader_ops ops = {reader_next, reader_close};
	struct reader *r = calloc(1, sizeof(*r));
	int rc = AVERROR(ENOMEM);

	av_log_set_level(AV_LOG_QUIET);
	if (r) {
		r->reader.ops = &ops;
		r->path = strdup(path);
		if (r->path)
			rc = begin(r);
		if (!rc)
			return &r->reader;
		reader_close(&r->reader);
	}
	rc = AVUNERROR(rc);
	if (rc <= 0 || rc > 4095)
		incise_error_set(err, EINVAL,
				 "%.300s: holds no pictures that incise recorded, or is "
				 "damaged in its first bytes",
				 path);
	else
		incise_error_set(err, rc, "%.300s: cannot be read: %s", path,
				 strerror(rc));
	return NULL;
}
