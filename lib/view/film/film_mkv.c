// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A film in Matroska or MP4 by libavformat: H.264 by libx264, else in Matroska MJPEG; see
 * ../film.h.
 *
 *     RGB ─► Y'CbCr 4:2:0 (BT.709 for H.264, BT.601 full range for MJPEG) ─► coder ─► .mkv, .mp4
 */
#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/opt.h>
#include "../film.h"

/* Quality: H.264 on a scale of 0 … 51, MJPEG of 2 … 31; visually lossless. */
#define H264_CRF "20"
#define MJPEG_SCALE 3

struct incise_film_coder {
	AVFormatContext *format;
	AVCodecContext *codec;
	AVFrame *frame;
	AVPacket *packet;
	int64_t frames;
	bool begun;	    /* the header is written */
	char url[5 + 4096]; /* "file:" and the path: a colon in it begins no protocol */
	const char *path;
};

/* Weights of red, green and blue by a standard, in 2^-16. */
struct weights {
	int y[3], cb[3], cr[3], offset;
};

static const struct weights bt709 = {
	.y = {11966, 40254, 4064}, /* limited range: 16 … 235 */
	.cb = {-6596, -22189, 28785},
	.cr = {28785, -26145, -2640},
	.offset = 16,
};
static const struct weights bt601_full = {
	.y = {19595, 38470, 7471},
	.cb = {-11059, -21709, 32768},
	.cr = {32768, -27439, -5329},
	.offset = 0,
};

static int av_fail(struct incise_film_coder *coder, int rc, const char *what,
		   struct incise_error *err)
{
	int code = AVUNERROR(rc);

	/* libav has codes that are no errno. */
	if (code <= 0 || code > 4095)
		code = EIO;
	return incise_error_set(err, code, "%.300s: %s: %s", coder->path, what,
				strerror(code));
}

static uint8_t weigh(const int w[3], const int rgb[3], int shift, int offset)
{
	int value =
		((w[0] * rgb[0] + w[1] * rgb[1] + w[2] * rgb[2] + (1 << (shift - 1))) >>
		 shift) +
		offset;

	return (uint8_t)(value < 0 ? 0 : value > 255 ? 255 : value);
}

/* 2 × 2 pixels share the colour of their mean. */
static void convert(AVFrame *frame, const uint8_t *rgb, const struct weights *weights)
{
	int width = frame->width, height = frame->height;

	for (int row = 0; row < height; row += 2)
		for (int column = 0; column < width; column += 2) {
			int sum[3] = {0};

			for (int k = 0; k < 4; k++) {
				int y = row + k / 2, x = column + k % 2;
				const uint8_t *at = rgb + 3 * ((size_t)y * width + x);
				const int pixel[3] = {at[0], at[1], at[2]};

				frame->data[0][y * frame->linesize[0] + x] =
					weigh(weights->y, pixel, 16, weights->offset);
				for (int i = 0; i < 3; i++)
					sum[i] += pixel[i];
			}
			frame->data[1][row / 2 * frame->linesize[1] + column / 2] =
				weigh(weights->cb, sum, 18, 128);
			frame->data[2][row / 2 * frame->linesize[2] + column / 2] =
				weigh(weights->cr, sum, 18, 128);
		}
}

static void free_coder(struct incise_film_coder *coder)
{
	av_packet_free(&coder->packet);
	av_frame_free(&coder->frame);
	avcodec_free_context(&coder->codec);
	if (coder->format)
		avio_closep(&coder->format->pb);
	avformat_free_context(coder->format);
	free(coder);
}

static int open_codec(struct incise_film_coder *coder, bool mp4, int width, int height,
		      int rate_hz)
{
	const AVCodec *codec = avcodec_find_encoder_by_name("libx264");
	AVCodecContext *c;

	/* Players of MP4 expect H.264. */
	if (!codec && !mp4)
		codec = avcodec_find_encoder(AV_CODEC_ID_MJPEG);
	if (!codec)
		return AVERROR(ENOTSUP);
	c = coder->codec = avcodec_alloc_context3(codec);
	if (!c)
		return AVERROR(ENOMEM);
	c->width = width;
	c->height = height;
	c->time_base = (AVRational){1, rate_hz};
	c->framerate = (AVRational){rate_hz, 1};
	if (coder->format->oformat->flags & AVFMT_GLOBALHEADER)
		c->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
	if (codec->id == AV_CODEC_ID_H264) {
		c->pix_fmt = AV_PIX_FMT_YUV420P;
		c->colorspace = AVCOL_SPC_BT709;
		c->color_primaries = AVCOL_PRI_BT709;
		c->color_trc = AVCOL_TRC_BT709;
		c->color_range = AVCOL_RANGE_MPEG;
		av_opt_set(c->priv_data, "preset", "veryfast", 0);
		av_opt_set(c->priv_data, "crf", H264_CRF, 0);
	} else {
		c->pix_fmt = AV_PIX_FMT_YUVJ420P;
		c->color_range = AVCOL_RANGE_JPEG;
		c->flags |= AV_CODEC_FLAG_QSCALE;
		c->global_quality = FF_QP2LAMBDA * MJPEG_SCALE;
	}
	return avcodec_open2(c, codec, NULL);
}

static int open_frame(struct incise_film_coder *coder)
{
	coder->frame = av_frame_alloc();
	coder->packet = av_packet_alloc();
	if (!coder->frame || !coder->packet)
		return AVERROR(ENOMEM);
	coder->frame->format = coder->codec->pix_fmt;
	coder->frame->width = coder->codec->width;
	coder->frame->height = coder->codec->height;
	coder->frame->quality = coder->codec->global_quality;
	return av_frame_get_buffer(coder->frame, 0);
}

static int open_film_file(struct incise_film_coder *coder)
{
	AVDictionary *options = NULL; /* Matroska has no movflags, and ignores them */
	AVStream *stream = avformat_new_stream(coder->format, NULL);
	int rc;

	if (!stream)
		return AVERROR(ENOMEM);
	stream->time_base = coder->codec->time_base;
	stream->avg_frame_rate = coder->codec->framerate;
	rc = avcodec_parameters_from_context(stream->codecpar, coder->codec);
	if (rc >= 0)
		rc = avio_open(&coder->format->pb, coder->url, AVIO_FLAG_WRITE);
	/* The index of an MP4 comes first, so that a page plays it while it loads; in a pipe, by
	 * fragments. */
	if (rc >= 0)
		av_dict_set(&options, "movflags",
			    coder->format->pb->seekable ? "faststart"
							: "frag_keyframe+delay_moov",
			    0);
	if (rc >= 0)
		rc = avformat_write_header(coder->format, &options);
	av_dict_free(&options);
	coder->begun = rc >= 0;
	return rc;
}

static struct incise_film_coder *film_open(const char *path, bool mp4, int width,
					   int height, int rate_hz,
					   struct incise_error *err)
{
	struct incise_film_coder *coder = calloc(1, sizeof(*coder));
	int rc = AVERROR(ENAMETOOLONG);

	if (!coder)
		return INCISE_ERROR_NULL(err, ENOMEM, "no memory for a film");
	/* Warnings about the input are not for users. */
	av_log_set_level(AV_LOG_ERROR);
	coder->path = coder->url + strlen("file:");
	if (snprintf(coder->url, sizeof(coder->url), "file:%s", path) <
	    (int)sizeof(coder->url))
		rc = avformat_alloc_output_context2(&coder->format, NULL,
						    mp4 ? "mp4" : "matroska", coder->url);
	if (rc >= 0)
		rc = open_codec(coder, mp4, width, height, rate_hz);
	if (rc >= 0)
		rc = open_frame(coder);
	if (rc >= 0)
		rc = open_film_file(coder);
	if (rc >= 0)
		return coder;
	rc = av_fail(coder, rc,
		     mp4 && rc == AVERROR(ENOTSUP)
			     ? "MP4 needs libavcodec's libx264; give a name in .mkv"
			     : "the film cannot be started",
		     err);
	free_coder(coder);
	errno = -rc;
	return NULL;
}

/* Write the packets that are ready. */
static int drain(struct incise_film_coder *coder)
{
	AVStream *stream = coder->format->streams[0];
	int rc;

	while ((rc = avcodec_receive_packet(coder->codec, coder->packet)) >= 0) {
		av_packet_rescale_ts(coder->packet, coder->codec->time_base,
				     stream->time_base);
		coder->packet->stream_index = 0;
		rc = av_interleaved_write_frame(coder->format, coder->packet);
		if (rc < 0)
			return rc;
	}
	return rc == AVERROR(EAGAIN) || rc == AVERROR_EOF ? 0 : rc;
}

static int film_add(struct incise_film_coder *coder, const uint8_t *rgb,
		    struct incise_error *err)
{
	bool h264 = coder->codec->pix_fmt == AV_PIX_FMT_YUV420P;
	int rc = av_frame_make_writable(coder->frame);

	if (rc >= 0) {
		convert(coder->frame, rgb, h264 ? &bt709 : &bt601_full);
		coder->frame->pts = coder->frames++;
		rc = avcodec_send_frame(coder->codec, coder->frame);
	}
	if (rc >= 0)
		rc = drain(coder);
	if (rc >= 0 && coder->format->pb->error < 0)
		rc = coder->format->pb->error;
	return rc < 0 ? av_fail(coder, rc, "the film cannot be written", err) : 0;
}

static int film_close(struct incise_film_coder *coder, struct incise_error *err)
{
	int rc = avcodec_send_frame(coder->codec, NULL);

	if (rc >= 0)
		rc = drain(coder);
	if (coder->begun) {
		int end = av_write_trailer(coder->format);

		rc = rc < 0 ? rc : end;
	}
	if (rc >= 0 && coder->format->pb->error < 0)
		rc = coder->format->pb->error;
	if (rc >= 0)
		rc = avio_closep(&coder->format->pb);
	rc = rc < 0 ? av_fail(coder, rc, "the film cannot be closed", err) : 0;
	free_coder(coder);
	return rc;
}

INCISE_API extern const struct incise_film_module incise_film_module;
const struct incise_film_module incise_film_module = {INCISE_FILM_ABI, film_open,
						      film_add, film_close};
