// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Writing and reading camera.mkv, a module on libavformat; ../frames.h describes the file.
 *
 *     frame ─► planes ─► MagicYUV ┐
 *                                 ├─► note ─► one cluster ─► write(2) ─► good_size
 *     MJPEG ──────────────────────┘
 *
 * The muxer gets no way to seek and "live": it keeps no index, which would grow without limit,
 * and patches nothing. It ends its cluster behind each frame: it would keep the frames of an
 * open one in memory, where a kill loses them. That costs 40 bytes each.
 *
 * The reader reads from the front to the end, without an index or lengths. A file is data from
 * outside: sizes are checked before use, and a frame with a wrong CRC is not decoded.
 */
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/crc.h>
#include <libavutil/frame.h>
#include <libavutil/intreadwrite.h>
#include "../../base/crypto/sha256.h"
#include "../../base/monotonic.h"
#include "../frames.h"

#define BUFFER_BYTES (1 << 20) /* one write(2) for most frames */
#define NS_PER_MS 1000000
#define BLOCK_ADD_ID 1
#define NOTE_BYTES 24

/* --- the note of each frame ------------------------------------------------------------ */

struct note {
	uint32_t crc;
	int64_t t_ns;
	uint64_t seq;
};

static const uint8_t mark[4] = {'I', 'N', 'C', 1};

static void note_write(const struct note *note, uint8_t bytes[NOTE_BYTES])
{
	memcpy(bytes, mark, sizeof(mark));
	AV_WB32(bytes + 4, note->crc);
	AV_WB64(bytes + 8, (uint64_t)note->t_ns);
	AV_WB64(bytes + 16, note->seq);
}

/* False: not written by incise. */
static bool note_read(struct note *note, const uint8_t *bytes, size_t size)
{
	if (size != NOTE_BYTES || memcmp(bytes, mark, sizeof(mark)))
		return false;
	note->crc = AV_RB32(bytes + 4);
	note->t_ns = (int64_t)AV_RB64(bytes + 8);
	note->seq = AV_RB64(bytes + 16);
	return true;
}

static uint32_t crc_of(const uint8_t *bytes, size_t size)
{
	return ~av_crc(av_crc_get_table(AV_CRC_32_IEEE_LE), ~0U, bytes, size);
}

static bool digest_of(const AVPacket *packet, struct incise_frames_stored *stored)
{
	return !incise_sha256_of(packet->data, (size_t)packet->size, stored->sha256);
}

/*
 * --- planes: pixels of a camera to those of the codec and back, without loss -------------
 *
 *     YUYV  Y0 U Y1 V …  ◄──►  yuv422p  Y0 Y1 …, U …, V …
 *     RGB   R G B …      ◄──►  gbrp     G …, B …, R …
 *                        ◄───  bgr0     B G R 0 …, of FFV1
 *     grey                     gray8
 */

static enum AVPixelFormat planes_format(enum incise_pixels pixels)
{
	switch (pixels) {
	case INCISE_PIXELS_RGB:
		return AV_PIX_FMT_GBRP;
	case INCISE_PIXELS_GREY:
		return AV_PIX_FMT_GRAY8;
	case INCISE_PIXELS_YUYV:
		return AV_PIX_FMT_YUV422P;
	default:
		return AV_PIX_FMT_NONE;
	}
}

static uint8_t *row_of(const AVFrame *planes, int plane, int y)
{
	return planes->data[plane] + (ptrdiff_t)y * planes->linesize[plane];
}

static void yuyv_from(const AVFrame *planes, int y, const uint8_t *restrict from)
{
	uint8_t *restrict luma = row_of(planes, 0, y);
	uint8_t *restrict u = row_of(planes, 1, y), *restrict v = row_of(planes, 2, y);

	for (int x = 0; x < planes->width / 2; x++) {
		luma[2 * x] = from[4 * x];
		u[x] = from[4 * x + 1];
		luma[2 * x + 1] = from[4 * x + 2];
		v[x] = from[4 * x + 3];
	}
}

static void yuyv_to(const AVFrame *planes, int y, uint8_t *restrict to)
{
	const uint8_t *luma = row_of(planes, 0, y);
	const uint8_t *u = row_of(planes, 1, y), *v = row_of(planes, 2, y);

	for (int x = 0; x < planes->width / 2; x++) {
		to[4 * x] = luma[2 * x];
		to[4 * x + 1] = u[x];
		to[4 * x + 2] = luma[2 * x + 1];
		to[4 * x + 3] = v[x];
	}
}

static void rgb_from(const AVFrame *planes, int y, const uint8_t *restrict from)
{
	uint8_t *restrict green = row_of(planes, 0, y);
	uint8_t *restrict blue = row_of(planes, 1, y);
	uint8_t *restrict red = row_of(planes, 2, y);

	for (int x = 0; x < planes->width; x++) {
		red[x] = from[3 * x];
		green[x] = from[3 * x + 1];
		blue[x] = from[3 * x + 2];
	}
}

static void rgb_to(const AVFrame *planes, int y, uint8_t *restrict to)
{
	bool packed = planes->format == AV_PIX_FMT_BGR0;
	const uint8_t *first = row_of(planes, 0, y);
	const uint8_t *green = packed ? first + 1 : first;
	const uint8_t *blue = packed ? first : row_of(planes, 1, y);
	const uint8_t *red = packed ? first + 2 : row_of(planes, 2, y);

	for (int x = 0, at = 0; x < planes->width; x++, at += packed ? 4 : 1) {
		to[3 * x] = red[at];
		to[3 * x + 1] = green[at];
		to[3 * x + 2] = blue[at];
	}
}

static void planes_from(AVFrame *planes, const struct incise_camera_frame *frame)
{
	for (int y = 0; y < planes->height; y++) {
		const uint8_t *from = frame->data + (size_t)y * frame->stride;

		if (frame->pixels == INCISE_PIXELS_YUYV)
			yuyv_from(planes, y, from);
		else if (frame->pixels == INCISE_PIXELS_RGB)
			rgb_from(planes, y, from);
		else
			memcpy(row_of(planes, 0, y), from, (size_t)planes->width);
	}
}

static void planes_to(const AVFrame *planes, enum incise_pixels pixels, uint8_t *data)
{
	size_t row = incise_frames_row(pixels, planes->width);

	for (int y = 0; y < planes->height; y++, data += row) {
		if (pixels == INCISE_PIXELS_YUYV)
			yuyv_to(planes, y, data);
		else if (pixels == INCISE_PIXELS_RGB)
			rgb_to(planes, y, data);
		else
			memcpy(data, row_of(planes, 0, y), row);
	}
}

/* --- writer ---------------------------------------------------------------------------- */

struct writer {
	struct incise_frames_writer writer;
	struct incise_frames_shape shape;
	char *path;
	int fd;
	int io_errno;	   /* of the first write(2) that failed */
	int failed;	   /* negative errno: no more is written */
	int64_t size;	   /* of the file */
	int64_t good_size; /* behind the last frame */
	int64_t sync_ns, synced_ns;
	bool started;
	int64_t first_ns, last_ms;
	AVFormatContext *format;
	AVCodecContext *codec; /* NULL: MJPEG */
	AVFrame *planes;
	AVPacket *packet;
};

static struct writer *writer_of(struct incise_frames_writer *writer)
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

/* Report @rc of libav, and end the file behind its last frame. */
static int fail_frames_mkv(struct writer *w, int rc, const char *what,
			   struct incise_error *err)
{
	int code = w->io_errno ? w->io_errno : AVUNERROR(rc);

	/* libav also has codes that are no errno. */
	if (code <= 0 || code > 4095)
		code = EIO;
	w->failed = -code;
	if (w->size > w->good_size && !ftruncate(w->fd, w->good_size))
		w->size = w->good_size;
	if (code == ENOSPC || code == EDQUOT || code == EFBIG)
		return incise_error_set(
			err, code,
			"%.300s: disk full (or a quota or limit on files); the frames "
			"end here, earlier ones are kept",
			w->path);
	return incise_error_set(err, code,
				"%.300s: %s: %s; the frames end here, earlier ones are "
				"kept",
				w->path, what, strerror(code));
}

/* Nearest ms after the first frame, and later than the frame before. */
static int64_t pts_of(struct writer *w, int64_t t_ns)
{
	int64_t after_ns, ms;

	if (!w->started) {
		w->started = true;
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

/* On success the packet is filled. */
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
	const struct note note = {crc, frame->t_ns, frame->seq};
	uint8_t *side = av_packet_new_side_data(
		w->packet, AV_PKT_DATA_MATROSKA_BLOCKADDITIONAL, 8 + NOTE_BYTES);

	if (!side)
		return AVERROR(ENOMEM);
	AV_WB64(side, BLOCK_ADD_ID);
	note_write(&note, side + 8);
	return 0;
}

/* Write the packet and end its cluster. */
static int mux(struct writer *w)
{
	int rc = av_write_frame(w->format, w->packet);

	if (rc >= 0)
		rc = av_write_frame(w->format, NULL);
	avio_flush(w->format->pb);
	return w->io_errno ? AVERROR(w->io_errno) : rc < 0 ? rc : 0;
}

static bool fits_frames_mkv(const struct incise_frames_shape *shape,
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
	struct writer *w = writer_of(writer);
	int64_t now;
	int rc;

	if (w->failed)
		return incise_error_set(err, -w->failed,
					"%.300s: the frames have ended: %s", w->path,
					strerror(-w->failed));
	if (!fits_frames_mkv(&w->shape, frame))
		return incise_error_set(err, EINVAL,
					"%.300s: a frame of %d × %d, %zu bytes, "
					"differs from the format of the camera",
					w->path, frame->width, frame->height,
					frame->size);
	stored->pts_ms = pts_of(w, frame->t_ns);
	rc = encode(w, frame);
	if (rc)
		return fail_frames_mkv(w, rc, "a frame cannot be encoded", err);
	stored->bytes = (uint32_t)w->packet->size;
	stored->crc = crc_of(w->packet->data, (size_t)w->packet->size);
	w->packet->pts = w->packet->dts = stored->pts_ms;
	w->packet->flags |= AV_PKT_FLAG_KEY;
	rc = digest_of(w->packet, stored) ? add_note(w, frame, stored->crc)
					  : AVERROR(ENOMEM);
	if (!rc)
		rc = mux(w);
	av_packet_unref(w->packet);
	if (rc)
		return fail_frames_mkv(w, rc, "cannot be written", err);
	w->good_size = w->size;
	now = w->sync_ns ? incise_monotonic_ns() : 0;
	if (w->sync_ns && now - w->synced_ns >= w->sync_ns) {
		if (fdatasync(w->fd) && errno != EINVAL)
			return fail_frames_mkv(w, AVERROR(errno), "cannot be synced",
					       err);
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
	struct writer *w = writer_of(writer);
	int rc = 0;

	/* After a failure the trailer only frees the muxer's memory; nothing is written. */
	if (w->failed)
		w->io_errno = -w->failed;
	rc = av_write_trailer(w->format);
	if (!w->failed) {
		avio_flush(w->format->pb);
		if (rc < 0 || w->io_errno)
			fail_frames_mkv(w, rc, "cannot be closed", err);
		else if (fsync(w->fd) && errno != EINVAL)
			fail_frames_mkv(w, AVERROR(errno), "cannot be synced", err);
	} else {
		incise_error_set(err, -w->failed, "%.300s: the frames have ended: %s",
				 w->path, strerror(-w->failed));
	}
	rc = w->failed;
	writer_free(w);
	return rc;
}

static int open_encoder(struct writer *w)
{
	const AVCodec *codec = avcodec_find_encoder(AV_CODEC_ID_MAGICYUV);
	AVCodecContext *c;
	int rc;

	if (!codec)
		return AVERROR(ENOSYS);
	c = w->codec = avcodec_alloc_context3(codec);
	w->planes = av_frame_alloc();
	if (!c || !w->planes)
		return AVERROR(ENOMEM);
	c->width = w->planes->width = w->shape.width;
	c->height = w->planes->height = w->shape.height;
	c->pix_fmt = planes_format(w->shape.pixels);
	w->planes->format = c->pix_fmt;
	c->time_base = (AVRational){1, 1000};
	/* A decoder that works ahead would keep frames. */
	c->thread_count = 1;
	rc = avcodec_open2(c, codec, NULL);
	return rc ? rc : av_frame_get_buffer(w->planes, 0);
}

/* Write the header, up to the first cluster. */
static int write_header(struct writer *w)
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
		rc = open_encoder(w);
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

static struct incise_frames_writer *writer_new(
	const char *path, const struct incise_frames_shape *shape,
	const struct incise_frames_options *options, struct incise_error *err)
{
	struct writer *w;
	int rc;

	if (!is_shape(shape))
		return INCISE_ERROR_NULL(
			err, EINVAL,
			"%.300s: frames of %d × %d in this format cannot be "
			"recorded; set another size or format of the camera",
			path, shape->width, shape->height);
	w = calloc(1, sizeof(*w));
	if (w)
		w->path = strdup(path);
	if (!w || !w->path) {
		free(w);
		return INCISE_ERROR_NULL(err, ENOMEM, "%.300s: out of memory", path);
	}
	/* Errors come back as codes; libav prints nothing. */
	av_log_set_level(AV_LOG_QUIET);
	static const struct incise_frames_writer_ops ops = {writer_put, writer_close};
	w->writer.ops = &ops;
	w->shape = *shape;
	w->sync_ns = options && options->sync_ns > 0 ? options->sync_ns : 0;
	w->synced_ns = incise_monotonic_ns();
	w->fd = open(path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
	if (w->fd < 0) {
		incise_error_set(err, errno, "%.300s: cannot be created: %s", path,
				 strerror(errno));
		rc = -errno;
	} else {
		rc = write_header(w);
		if (!rc)
			return &w->writer;
		rc = fail_frames_mkv(w, rc, "cannot be started", err);
		unlink(path);
	}
	writer_free(w);
	errno = -rc;
	return NULL;
}

/* --- reader ---------------------------------------------------------------------------- */

#define NS_PER_MS 1000000

struct frames_mkv_reader {
	struct incise_frames_reader reader;
	char *path;
	AVFormatContext *format; /* NULL: there is no frame */
	AVCodecContext *codec;	 /* NULL: MJPEG */
	AVFrame *planes;
	AVPacket *packet;
	uint8_t *data;
	size_t capacity;
	uint64_t next_seq; /* for a file without notes */
};

static struct frames_mkv_reader *reader_of(struct incise_frames_reader *reader)
{
	return (struct frames_mkv_reader *)reader;
}

/* Read the packet's note. False: there is none, and the note is made up from the packet. */
static bool read_note(struct frames_mkv_reader *r, struct note *note)
{
	size_t size = 0;
	const uint8_t *side = av_packet_get_side_data(
		r->packet, AV_PKT_DATA_MATROSKA_BLOCKADDITIONAL, &size);

	if (side && size > 8 && note_read(note, side + 8, size - 8))
		return true;
	*note = (struct note){
		.seq = r->next_seq,
		.t_ns = r->packet->pts > INT64_MIN / NS_PER_MS &&
					r->packet->pts < INT64_MAX / NS_PER_MS
				? r->packet->pts * NS_PER_MS
				: 0,
	};
	return false;
}

static int bad(struct frames_mkv_reader *r, const struct note *note, const char *why,
	       struct incise_error *err)
{
	return incise_error_set(err, EBADMSG, "%.300s: picture %llu: %s", r->path,
				(unsigned long long)note->seq, why);
}

static bool pixels_of(int format, enum incise_pixels *pixels)
{
	if (format == AV_PIX_FMT_BGR0)
		format = AV_PIX_FMT_GBRP;
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

/* The codec's pixels to the camera's pixels. 0, -EBADMSG, -ENOMEM; sets no error text. */
static int decode_frames_mkv(struct frames_mkv_reader *r,
			     struct incise_camera_frame *frame)
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
	if (size > r->capacity) {
		uint8_t *larger = realloc(r->data, size);

		if (!larger)
			return -ENOMEM;
		r->data = larger;
		r->capacity = size;
	}
	planes_to(r->planes, frame->pixels, r->data);
	frame->width = r->planes->width;
	frame->height = r->planes->height;
	frame->stride = (int)row;
	frame->data = r->data;
	frame->size = size;
	return 0;
}

/* Whether the writer was killed before the first cluster; libavformat opens no such file. */
static bool is_without_frames(const char *path)
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
	/* Or killed within the length of the first cluster. */
	return !found || found + 12 > head + n;
}

static int reader_next(struct incise_frames_reader *reader,
		       struct incise_camera_frame *frame,
		       struct incise_frames_stored *stored, struct incise_error *err)
{
	struct frames_mkv_reader *r = reader_of(reader);
	const AVCodecParameters *codec;
	struct note note;
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
	/* A truncated cluster ends the file like its end. */
	if (rc < 0)
		return 0;
	/* MagicYUV, and FFV1 before ffmpeg 7, are in Matroska as in AVI, with times as dts. */
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
		.crc = crc_of(r->packet->data, (size_t)r->packet->size),
	};
	if (reader->digests && !digest_of(r->packet, stored))
		return incise_error_set(err, ENOMEM, "%.300s: out of memory", r->path);
	if (!r->packet->size || (noted && stored->crc != note.crc))
		return bad(r, &note, "its bytes differ from those recorded", err);
	if (!r->codec) {
		frame->data = r->packet->data;
		frame->size = (size_t)r->packet->size;
		return 1;
	}
	if (reader->undecoded)
		return 1;
	rc = decode_frames_mkv(r, frame);
	if (rc == -ENOMEM)
		return incise_error_set(err, ENOMEM, "%.300s: out of memory", r->path);
	return rc ? bad(r, &note, "cannot be decoded", err) : 1;
}

static void reader_close(struct incise_frames_reader *reader)
{
	struct frames_mkv_reader *r = reader_of(reader);

	avcodec_free_context(&r->codec);
	av_frame_free(&r->planes);
	av_packet_free(&r->packet);
	avformat_close_input(&r->format);
	free(r->data);
	free(r->path);
	free(r);
}

static int open_decoder(struct frames_mkv_reader *r, const AVCodecParameters *parameters)
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
static int open_frames_mkv_file(struct frames_mkv_reader *r)
{
	const AVCodecParameters *codec;
	AVDictionary *options = NULL;
	char *url = NULL;
	int rc;

	/* "file:": a colon in the path does not name a protocol. */
	if (asprintf(&url, "file:%s", r->path) < 0)
		return AVERROR(ENOMEM);
	av_dict_set(&options, "protocol_whitelist", "file", 0);
	rc = avformat_open_input(&r->format, url, av_find_input_format("matroska"),
				 &options);
	av_dict_free(&options);
	free(url);
	if (rc < 0 && rc != AVERROR(ENOMEM) && is_without_frames(r->path))
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
	r->reader.codec = avcodec_get_name(codec->codec_id);
	if (codec->codec_id == AV_CODEC_ID_MJPEG)
		return 0;
	/* FFV1: before, frames were written so. */
	return codec->codec_id == AV_CODEC_ID_MAGICYUV ||
			       codec->codec_id == AV_CODEC_ID_FFV1
		       ? open_decoder(r, codec)
		       : AVERROR_INVALIDDATA;
}

static struct incise_frames_reader *reader_new(const char *path, struct incise_error *err)
{
	static const struct incise_frames_reader_ops ops = {reader_next, reader_close};
	struct frames_mkv_reader *r = calloc(1, sizeof(*r));
	int rc = AVERROR(ENOMEM);

	av_log_set_level(AV_LOG_QUIET);
	if (r) {
		r->reader.ops = &ops;
		r->path = strdup(path);
		if (r->path)
			rc = open_frames_mkv_file(r);
		if (!rc)
			return &r->reader;
		reader_close(&r->reader);
	}
	rc = AVUNERROR(rc);
	if (rc <= 0 || rc > 4095)
		incise_error_set(err, EINVAL,
				 "%.300s: has no frames of incise, or is damaged in "
				 "its first bytes",
				 path);
	else
		incise_error_set(err, rc, "%.300s: cannot be read: %s", path,
				 strerror(rc));
	return NULL;
}

const struct incise_frames_module incise_frames = {
	.abi = INCISE_FRAMES_ABI,
	.create = writer_new,
	.open = reader_new,
};
