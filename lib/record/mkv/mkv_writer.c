// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Writing camera.mkv; see ../record/frames.h.
 *
 *     frame ─► planes ─► FFV1 ┐
 *                             ├─► note ─► one cluster ─► write(2) ─► good_size
 *     MJPEG ──────────────────┘
 *
 * The muxer gets no way to seek and "live": it keeps no index, which would grow for ever, and
 * patches nothing. It is told to end its cluster behind each picture: it would keep the
 * pictures of an open one in memory, where a kill takes them. That costs 40 bytes each.
 */
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/intreadwrite.h>
#include <libavutil/opt.h>
#include "mkv.h"
#include "planes.h"

#define BUFFER_BYTES (1 << 20) /* one write(2) for most pictures */
#define SLICES 4
#define NS_PER_MS 1000000
#define BLOCK_ADD_ID 1

struct writer {
	struct incise_frames_writer writer;
	struct incise_frames_shape shape;
	char *path;
	int fd;
	int io_errno;	   /* of the first write(2) that failed */
	int failed;	   /* negative errno: no more is written */
	int64_t size;	   /* of the file */
	int64_t good_size; /* behind the last picture */
	int64_t sync_ns, synced_ns;
	bool begun;
	int64_t first_ns, last_ms;
	AVFormatContext *format;
	AVCodecContext *codec; /* NULL: MJPEG */
	AVFrame *planes;
	AVPacket *packet;
};

static struct writer *of(struct incise_frames_writer *writer)
{
	return (struct writer *)writer;
}

#if LIBAVFORMAT_VERSION_MAJOR >= 61
static int write_bytes(void *opaque, const uint8_t *bytes, int n)
#else
static int write_bytes(void *opaque, uint8_t *bytes, int n)
#endif
{
	struct writer *w = opaque;
	int left = n;

	while (left > 0 && !w->io_errno) {
		ssize_t done = write(w->fd, bytes, (size_t)left);

		if (done < 0 && errno == EINTR)
			continue;
		if (done <= 0) {
			w->io_errno = done ? errno : EIO;
			break;
		}
		bytes += done;
		left -= (int)done;
		w->size += done;
	}
	return w->io_errno ? AVERROR(w->io_errno) : n;
}

/* Say what @rc of libav means, once, and let the file end behind its last picture. */
static int fail(struct writer *w, int rc, const char *what, struct incise_error *err)
{
	int code = w->io_errno ? w->io_errno : AVUNERROR(rc);

	/* Codes of libav's own are no errno. */
	if (code <= 0 || code > 4095)
		code = EIO;
	w->failed = -code;
	if (w->size > w->good_size && !ftruncate(w->fd, w->good_size))
		w->size = w->good_size;
	if (code == ENOSPC || code == EDQUOT || code == EFBIG)
		return incise_error_set(
			err, code,
			"%.300s: disk full (or a quota or limit on files); "
			"the pictures end here, what came before is kept",
			w->path);
	return incise_error_set(err, code,
				"%.300s: %s: %s; the pictures end here, what came before "
				"is kept",
				w->path, what, strerror(code));
}

static int64_t clock_ns(void)
{
	struct timespec now;

	clock_gettime(CLOCK_MONOTONIC, &now);
	return now.tv_sec * 1000000000LL + now.tv_nsec;
}

/* To the nearest ms after the first picture, and always further on. */
static int64_t pts_of(struct writer *w, int64_t t_ns)
{
	int64_t after_ns, ms;

	if (!w->begun) {
		w->begun = true;
		w->first_ns = t_ns;
		return w->last_ms = 0;
	}
	ms = w->last_ms + 1;
	if (!__builtin_sub_overflow(t_ns, w->first_ns, &after_ns) &&
	    after_ns / NS_PER_MS > w->last_ms - 1) {
		after_ns = after_ns / NS_PER_MS + (after_ns % NS_PER_MS >= NS_PER_MS / 2);
		if (after_ns > ms)
			ms = after_ns;
	}
	return w->last_ms = ms;
}

/* Leaves the packet empty or filled. */
static int encode(struct writer *w, const struct incise_camera_frame *frame)
{
	int rc;

	if (!w->codec) {
		rc = av_new_packet(w->packet, (int)frame->size);
		if (!rc)
			memcpy(w->packet->data, frame->data, frame->size);
		return rc;
	}
	rc = av_frame_make_writable(w->planes);
	if (rc)
		return rc;
	planes_from(w->planes, frame);
	w->planes->pts = w->last_ms;
	rc = avcodec_send_frame(w->codec, w->planes);
	return rc ? rc : avcodec_receive_packet(w->codec, w->packet);
}

static int add_note(struct writer *w, const struct incise_camera_frame *frame,
		    uint32_t crc)
{
	const struct mkv_note note = {crc, frame->t_ns, frame->seq};
	uint8_t *side = av_packet_new_side_data(
		w->packet, AV_PKT_DATA_MATROSKA_BLOCKADDITIONAL, 8 + MKV_NOTE_BYTES);

	if (!side)
		return AVERROR(ENOMEM);
	AV_WB64(side, BLOCK_ADD_ID);
	mkv_note_write(&note, side + 8);
	return 0;
}

/* The packet, and the end of its cluster. */
static int mux(struct writer *w)
{
	int rc = av_write_frame(w->format, w->packet);

	if (rc >= 0)
		rc = av_write_frame(w->format, NULL);
	avio_flush(w->format->pb);
	return w->io_errno ? AVERROR(w->io_errno) : rc < 0 ? rc : 0;
}

static bool fits(const struct incise_frames_shape *shape,
		 const struct incise_camera_frame *frame)
{
	size_t row = incise_frames_row(shape->pixels, shape->width);

	if (frame->width != shape->width || frame->height != shape->height ||
	    frame->pixels != shape->pixels || !frame->data || !frame->size ||
	    frame->size > INCISE_FRAMES_BYTES_MAX)
		return false;
	if (!row)
		return true;
	return frame->stride > 0 && (size_t)frame->stride >= row &&
	       frame->size >= (size_t)frame->stride * (size_t)(shape->height - 1) + row;
}

static int writer_put(struct incise_frames_writer *writer,
		      const struct incise_camera_frame *frame,
		      struct incise_frames_stored *stored, struct incise_error *err)
{
	struct writer *w = of(writer);
	int64_t now;
	int rc;

	if (w->failed)
		return incise_error_set(err, -w->failed,
					"%.300s: the pictures have ended: %s", w->path,
					strerror(-w->failed));
	if (!fits(&w->shape, frame))
		return incise_error_set(err, EINVAL,
					"%.300s: a picture of %d × %d, %zu bytes, is not "
					"what the camera said it sends",
					w->path, frame->width, frame->height,
					frame->size);
	stored->pts_ms = pts_of(w, frame->t_ns);
	rc = encode(w, frame);
	if (rc)
		return fail(w, rc, "a picture cannot be encoded", err);
	stored->bytes = (uint32_t)w->packet->size;
	stored->crc = mkv_crc(w->packet->data, (size_t)w->packet->size);
	w->packet->pts = w->packet->dts = stored->pts_ms;
	w->packet->flags |= AV_PKT_FLAG_KEY;
	rc = add_note(w, frame, stored->crc);
	if (!rc)
		rc = mux(w);
	av_packet_unref(w->packet);
	if (rc)
		return fail(w, rc, "cannot be written", err);
	w->good_size = w->size;
	now = w->sync_ns ? clock_ns() : 0;
	if (w->sync_ns && now - w->synced_ns >= w->sync_ns) {
		if (fdatasync(w->fd) && errno != EINVAL)
			return fail(w, AVERROR(errno), "cannot be synced", err);
		w->synced_ns = now;
	}
	return 0;
}

static void writer_free(struct writer *w)
{
	avcodec_free_context(&w->codec);
	av_frame_free(&w->planes);
	av_packet_free(&w->packet);
	if (w->format && w->format->pb) {
		av_freep(&w->format->pb->buffer);
		avio_context_free(&w->format->pb);
	}
	avformat_free_context(w->format);
	if (w->fd >= 0)
		close(w->fd);
	free(w->path);
	free(w);
}

static int writer_close(struct incise_frames_writer *writer, struct incise_error *err)
{
	struct writer *w = of(writer);
	int rc = 0;

	/* The trailer of a failed file has no more to say, but frees what the muxer has. */
	if (w->failed)
		w->io_errno = -w->failed;
	rc = av_write_trailer(w->format);
	if (!w->failed) {
		avio_flush(w->format->pb);
		if (rc < 0 || w->io_errno)
			fail(w, rc, "cannot be ended", err);
		else if (fsync(w->fd) && errno != EINVAL)
			fail(w, AVERROR(errno), "cannot be synced", err);
	} else {
		incise_error_set(err, -w->failed, "%.300s: the pictures have ended: %s",
				 w->path, strerror(-w->failed));
	}
	rc = w->failed;
	writer_free(w);
	return rc;
}

static int open_codec(struct writer *w, int threads)
{
	const AVCodec *ffv1 = avcodec_find_encoder(AV_CODEC_ID_FFV1);
	AVCodecContext *c;
	int rc;

	if (!ffv1)
		return AVERROR(ENOSYS);
	c = w->codec = avcodec_alloc_context3(ffv1);
	w->planes = av_frame_alloc();
	if (!c || !w->planes)
		return AVERROR(ENOMEM);
	c->width = w->planes->width = w->shape.width;
	c->height = w->planes->height = w->shape.height;
	c->pix_fmt = planes_format(w->shape.pixels);
	w->planes->format = c->pix_fmt;
	c->time_base = (AVRational){1, 1000};
	c->level = 3;
	c->gop_size = 1;
	c->slices = SLICES;
	c->thread_count = threads > 1 ? threads < SLICES ? threads : SLICES : 1;
	c->thread_type = FF_THREAD_SLICE;
	av_opt_set_int(c->priv_data, "slicecrc", 1, 0);
	/* Golomb-Rice: 60 % of the range coder's CPU, and pictures no larger (check-frames). */
	av_opt_set_int(c->priv_data, "coder", 0, 0);
	rc = avcodec_open2(c, ffv1, NULL);
	return rc ? rc : av_frame_get_buffer(w->planes, 0);
}

/* The header, up to where the first cluster begins. */
static int begin(struct writer *w, int threads)
{
	AVDictionary *options = NULL;
	uint8_t *buffer;
	AVStream *stream;
	int rc = avformat_alloc_output_context2(&w->format, NULL, "matroska", NULL);

	if (rc < 0)
		return rc;
	w->packet = av_packet_alloc();
	buffer = av_malloc(BUFFER_BYTES);
	if (buffer)
		w->format->pb = avio_alloc_context(buffer, BUFFER_BYTES, 1, w, NULL,
						   write_bytes, NULL);
	if (!w->format->pb)
		av_free(buffer);
	stream = avformat_new_stream(w->format, NULL);
	if (!w->packet || !w->format->pb || !stream)
		return AVERROR(ENOMEM);
	w->format->flags |= AVFMT_FLAG_CUSTOM_IO | AVFMT_FLAG_FLUSH_PACKETS;
	stream->time_base = (AVRational){1, 1000};
	if (w->shape.pixels != INCISE_PIXELS_MJPEG) {
		rc = open_codec(w, threads);
		if (!rc)
			rc = avcodec_parameters_from_context(stream->codecpar, w->codec);
		if (rc < 0)
			return rc;
	} else {
		stream->codecpar->codec_type = AVMEDIA_TYPE_VIDEO;
		stream->codecpar->codec_id = AV_CODEC_ID_MJPEG;
		stream->codecpar->width = w->shape.width;
		stream->codecpar->height = w->shape.height;
	}
	if (w->shape.rate_hz > 0)
		stream->avg_frame_rate = av_d2q(w->shape.rate_hz, 1000000);
	av_dict_set(&options, "live", "1", 0);
	av_dict_set(&options, "cluster_time_limit", "100", 0);
	av_dict_set(&options, "flush_packets", "1", 0);
	rc = avformat_write_header(w->format, &options);
	av_dict_free(&options);
	if (rc < 0)
		return rc;
	avio_flush(w->format->pb);
	w->good_size = w->size;
	return w->io_errno ? AVERROR(w->io_errno) : 0;
}

static bool is_shape(const struct incise_frames_shape *s)
{
	return s->width >= INCISE_FRAMES_SIDE_MIN && s->width <= INCISE_FRAMES_SIDE_MAX &&
	       s->height >= INCISE_FRAMES_SIDE_MIN &&
	       s->height <= INCISE_FRAMES_SIDE_MAX && s->rate_hz >= 0 &&
	       s->rate_hz <= 1e6 &&
	       (s->pixels == INCISE_PIXELS_MJPEG || incise_frames_row(s->pixels, 1)) &&
	       (s->pixels != INCISE_PIXELS_YUYV || s->width % 2 == 0);
}

struct incise_frames_writer *mkv_writer_new(const char *path,
					    const struct incise_frames_shape *shape,
					    const struct incise_frames_options *options,
					    struct incise_error *err)
{
	struct writer *w;
	int rc;

	if (!is_shape(shape)) {
		incise_error_set(err, EINVAL,
				 "%.300s: pictures of %d × %d in this format cannot be "
				 "recorded; set the camera to others",
				 path, shape->width, shape->height);
		return NULL;
	}
	w = calloc(1, sizeof(*w));
	if (w)
		w->path = strdup(path);
	if (!w || !w->path) {
		free(w);
		incise_error_set(err, ENOMEM, "%.300s: out of memory", path);
		return NULL;
	}
	/* What goes wrong comes back as a code; nothing is for the terminal. */
	av_log_set_level(AV_LOG_QUIET);
	static const struct incise_frames_writer_ops ops = {writer_put, writer_close};
	w->writer.ops = &ops;
	w->shape = *shape;
	w->sync_ns = options && options->sync_ns > 0 ? options->sync_ns : 0;
	w->synced_ns = clock_ns();
	w->fd = open(path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
	if (w->fd < 0) {
		incise_error_set(err, errno, "%.300s: cannot be made: %s", path,
				 strerror(errno));
		rc = -errno;
	} else {
		rc = begin(w, options ? options->threads : 1);
		if (!rc)
			return &w->writer;
		rc = fail(w, rc, "cannot be begun", err);
		unlink(path);
	}
	writer_free(w);
	errno = -rc;
	return NULL;
}
