// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Films in Matroska, MP4 and an MP4 of a pipe, read back by libavformat and libavcodec: coding, the
 * number of frames, their times, and their colours up to coding losses; and files that cannot be
 * written.
 */
#include "../unit.h"
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include "../../../lib/view/film.h"

#define W 64
#define H 48
#define N 25
#define FPS 20

extern const struct incise_film_module incise_film_module;

static char path[] = "/tmp/incise-film-XXXXXX";
static bool without_h264;

const AVCodec *__real_avcodec_find_encoder_by_name(const char *name);

const AVCodec *__wrap_avcodec_find_encoder_by_name(const char *name)
{
	return without_h264 ? NULL : __real_avcodec_find_encoder_by_name(name);
}

/* A red square that moves over a grey that brightens to the right. */
static void picture(int n, uint8_t *rgb)
{
	for (int y = 0; y < H; y++)
		for (int x = 0; x < W; x++) {
			int in = x >= n && x < n + 16 && y >= 16 && y < 32;
			uint8_t grey = (uint8_t)(60 + 2 * x);
			const uint8_t pixel[] = {in ? 180 : grey, in ? 20 : grey,
						 in ? 20 : grey};

			memcpy(rgb + 3 * (y * W + x), pixel, 3);
		}
}

/* Expected brightness of a film of these, by the standard's weights. */
static double brightness(const uint8_t *rgb, bool limited)
{
	double y = limited ? 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]
			   : 0.299 * rgb[0] + 0.587 * rgb[1] + 0.114 * rgb[2];

	return limited ? 16 + y * 219 / 255 : y;
}

static void check_picture(const AVFrame *frame, int n)
{
	bool limited = frame->format == AV_PIX_FMT_YUV420P &&
		       frame->color_range != AVCOL_RANGE_JPEG;
	uint8_t rgb[W * H * 3];
	double off2 = 0;

	picture(n, rgb);
	for (int y = 0; y < H; y++)
		for (int x = 0; x < W; x++) {
			double off = frame->data[0][y * frame->linesize[0] + x] -
				     brightness(rgb + 3 * (y * W + x), limited);

			off2 += off * off;
		}
	/* 32 dB: a rms of 6.4 of 255; both coders stay below 4 at their quality. */
	assert_true(sqrt(off2 / (W * H)) < 6.4);
	/* The square is red, the rest grey, at half of the colour resolution. */
	assert_true(frame->data[2][12 * frame->linesize[2] + n / 2 + 4] > 165);
	assert_in_range(frame->data[2][4 * frame->linesize[2] + 4], 120, 136);
}

static int decode(AVFormatContext *format, AVCodecContext *codec)
{
	AVPacket *packet = av_packet_alloc();
	AVFrame *frame = av_frame_alloc();
	int n = 0, rc;

	do {
		rc = av_read_frame(format, packet);
		assert_int_equal(avcodec_send_packet(codec, rc ? NULL : packet), 0);
		av_packet_unref(packet);
		while (!avcodec_receive_frame(codec, frame)) {
			double t_s = (double)frame->best_effort_timestamp *
				     av_q2d(format->streams[0]->time_base);

			/* Matroska counts ms. */
			assert_true(fabs(t_s - (double)n / FPS) < 0.00051);
			check_picture(frame, n);
			n++;
		}
	} while (!rc);
	av_frame_free(&frame);
	av_packet_free(&packet);
	return n;
}

static void write_film(const char *to, bool mp4)
{
	struct incise_film_coder *coder;
	uint8_t rgb[W * H * 3];

	coder = incise_film_module.open(to, mp4, W, H, FPS, &err);
	succeeds(coder);
	for (int n = 0; n < N; n++) {
		picture(n, rgb);
		assert_int_equal(incise_film_module.add(coder, rgb, &err), 0);
	}
	assert_int_equal(incise_film_module.close(coder, &err), 0);
}

/* A film has no sound. */
static void check_film(const char *kind, enum AVCodecID id)
{
	AVFormatContext *format = NULL;
	AVCodecContext *codec;

	assert_int_equal(avformat_open_input(&format, path, NULL, NULL), 0);
	assert_non_null(strstr(format->iformat->name, kind));
	assert_true(avformat_find_stream_info(format, NULL) >= 0);
	assert_int_equal(format->nb_streams, 1);
	assert_int_equal(format->streams[0]->codecpar->codec_id, id);
	assert_int_equal(format->streams[0]->codecpar->width, W);
	codec = avcodec_alloc_context3(
		avcodec_find_decoder(format->streams[0]->codecpar->codec_id));
	avcodec_parameters_to_context(codec, format->streams[0]->codecpar);
	assert_int_equal(avcodec_open2(codec, codec->codec, NULL), 0);
	assert_int_equal(decode(format, codec), N);
	avcodec_free_context(&codec);
	avformat_close_input(&format);
}

/* libavcodec without it is one that Debian does not ship. */
static bool has_h264(void)
{
	if (__real_avcodec_find_encoder_by_name("libx264"))
		return true;
	puts("skipped: this libavcodec has no libx264");
	return false;
}

TEST(test_what_is_put_is_there)
{
	bool h264 = __real_avcodec_find_encoder_by_name("libx264");

	write_film(path, false);
	check_film("matroska", h264 ? AV_CODEC_ID_H264 : AV_CODEC_ID_MJPEG);
}

TEST(test_what_is_put_into_an_mp4_is_there)
{
	if (!has_h264())
		skip();
	write_film(path, true);
	check_film("mp4", AV_CODEC_ID_H264);
}

TEST(test_an_mp4_in_a_pipe_is_whole)
{
	char command[100], to[20];
	FILE *pipe;

	if (!has_h264())
		skip();
	snprintf(command, sizeof(command), "cat >%s", path);
	pipe = popen(command, "w");
	assert_non_null(pipe);
	snprintf(to, sizeof(to), "/dev/fd/%d", fileno(pipe));
	write_film(to, true);
	assert_int_equal(pclose(pipe), 0);
	check_film("mp4", AV_CODEC_ID_H264);
}

TEST(test_a_colon_is_no_protocol)
{
	char folder[] = "/tmp/incise-film-XXXXXX";

	assert_non_null(mkdtemp(folder));
	assert_int_equal(chdir(folder), 0);
	write_film("a:b.mkv", false);
	assert_int_equal(access("a:b.mkv", F_OK), 0);
	assert_int_equal(unlink("a:b.mkv"), 0);
	assert_int_equal(chdir("/"), 0);
	assert_int_equal(rmdir(folder), 0);
}

TEST(test_without_h264_matroska_only)
{
	without_h264 = true;
	write_film(path, false);
	check_film("matroska", AV_CODEC_ID_MJPEG);
	assert_error(incise_film_module.open("x.mp4", true, W, H, FPS, &err), ENOTSUP,
		     &err, "x.mp4", "libx264", ".mkv");
	without_h264 = false;
}

TEST(test_files_that_cannot_be)
{
	struct incise_film_coder *coder;
	uint8_t *rgb = calloc(1024 * 1024, 3);
	int rc = 0;

	assert_error(incise_film_module.open("/tmp/no/such/x.mkv", false, W, H, FPS,
					     &err),
		     ENOENT, &err, "/tmp/no/such/x.mkv");
	/* A full disk is reported when the film ends, at the latest. */
	coder = incise_film_module.open("/dev/full", false, 1024, 1024, FPS, &err);
	if (coder) {
		srand(1);
		for (int i = 0; i < 3 * 1024 * 1024; i++)
			rgb[i] = (uint8_t)rand();
		for (int n = 0; n < 4 && !rc; n++)
			rc = incise_film_module.add(coder, rgb, &err);
		rc |= incise_film_module.close(coder, &err);
		assert_true(rc < 0);
	}
	free(rgb);
}

static int begin(void **state)
{
	int fd = mkstemp(path);

	return fd < 0 ? -1 : close(fd);
}

static int end(void **state)
{
	return unlink(path);
}

GROUP(begin, end);
