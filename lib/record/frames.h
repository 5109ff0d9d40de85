/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Pictures in a file, NAME.rec/camera.mkv: Matroska with one track of video, MJPEG as it came
 * or FFV1, which loses nothing. What writes and reads it is a module on libavformat,
 * frames_mkv.so, mapped at first use, to stay.
 *
 *     camera ─► pump (frame_pump.h) ─► writer ─► camera.mkv ─► reader
 *
 * In the file:
 *   * one cluster per picture, whole in the kernel when put() returns: a kill costs no
 *     picture that was put. There is no index and nothing is patched in at the end, so a
 *     file that was cut off has the form of one that was not.
 *   * the time of a block is ms after the first picture: Matroska's usual scale, and the one
 *     that libavformat writes. It says t_ns to ± 0.5 ms; where pictures are closer than 1 ms
 *     it is made to step by 1 ms. Nothing is lost by it, because beside each picture is
 *   * BlockAdditional 1, 24 bytes, big-endian, which players pass over:
 *       0  'I' 'N' 'C' 1      4  CRC-32 (as zlib's) of the block's bytes
 *       8  t_ns, of CLOCK_MONOTONIC, signed      16  seq
 *   * FFV1: version 3, every picture by itself, 4 slices with a CRC each, Golomb-Rice.
 *     YUYV is yuv422p in it, grey gray8, RGB bgr0.
 *   * CRC-32 of each cluster, as Matroska has it.
 */
#ifndef INCISE_FRAMES_H
#define INCISE_FRAMES_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/camera.h>
#include <incise/error.h>

#define INCISE_FRAMES_FILE "camera.mkv" /* inside the folder NAME.rec */
#define INCISE_FRAMES_SIDE_MIN 16	/* pixels */
#define INCISE_FRAMES_SIDE_MAX 8192
#define INCISE_FRAMES_BYTES_MAX ((size_t)1 << 28) /* of a picture: 8192² RGB fits */

/* What does not change from picture to picture. YUYV is of even width. */
struct incise_frames_shape {
	int width, height;
	enum incise_pixels pixels;
	double rate_hz; /* a hint to players; 0: none */
};

struct incise_frames_options {
	int threads;	 /* of FFV1, 1 to 4; 0: 1, the one that calls put() */
	int64_t sync_ns; /* fdatasync(2) in put() so often; 0: in close() only */
};

/* How a picture is in the file. */
struct incise_frames_stored {
	int64_t pts_ms; /* unique, ascending */
	uint32_t bytes;
	uint32_t crc; /* CRC-32 of them */
};

/* --- writer ------------------------------------------------------------------------ */

struct incise_frames_writer;

struct incise_frames_writer_ops {
	int (*put)(struct incise_frames_writer *writer,
		   const struct incise_camera_frame *frame,
		   struct incise_frames_stored *stored, struct incise_error *err);
	int (*close)(struct incise_frames_writer *writer, struct incise_error *err);
};

/* One thread at a time. Blocks as long as the disk does. */
struct incise_frames_writer {
	const struct incise_frames_writer_ops *ops;
};

/*
 * Begin a file, which must not exist.
 * NULL with errno: EINVAL (a shape that is none), EEXIST, ENOMEM, those of open(2) and
 * write(2), and ENOENT, ENOEXEC (the module).
 */
struct incise_frames_writer *incise_frames_writer_new(
	const char *path, const struct incise_frames_shape *shape,
	const struct incise_frames_options *options, struct incise_error *err);

/*
 * 0: the picture is in the kernel, and a kill cannot take it. -EINVAL: it is not of the
 * shape, and the next one may be. Else (-ENOSPC, -EIO, …) the file ends behind the last
 * picture that was put, and every further call gives the same error.
 */
int incise_frames_put(struct incise_frames_writer *writer,
		      const struct incise_camera_frame *frame,
		      struct incise_frames_stored *stored, struct incise_error *err);

/* End and sync the file, free the writer. 0, or the error that ended it. NULL is allowed. */
int incise_frames_writer_close(struct incise_frames_writer *writer,
			       struct incise_error *err);

/* --- reader ------------------------------------------------------------------------ */

struct incise_frames_reader;

struct incise_frames_reader_ops {
	int (*next)(struct incise_frames_reader *reader,
		    struct incise_camera_frame *frame,
		    struct incise_frames_stored *stored, struct incise_error *err);
	void (*close)(struct incise_frames_reader *reader);
};

/* One thread at a time. */
struct incise_frames_reader {
	const struct incise_frames_reader_ops *ops;
	/* May be set between two pictures: FFV1 is not decoded, which takes some 25 ms, and
	 * pictures of it have no data. Their bytes are held against their CRC as ever. */
	bool undecoded;
};

/*
 * Open a file, which may be cut off, or still grow. NULL with errno: EINVAL (it is no file of
 * this kind), ENOMEM, those of open(2), and ENOENT, ENOEXEC (the module).
 */
struct incise_frames_reader *incise_frames_reader_new(const char *path,
						      struct incise_error *err);

/*
 * The next picture, as it was put, with stride of its width; its bytes are the reader's until
 * the next call. 1; 0 at the end, also where it was cut off; -EBADMSG: one that is
 * altered (its t_ns and seq are as the file says, its data NULL), and the next may be read;
 * -EIO, -ENOMEM.
 */
int incise_frames_next(struct incise_frames_reader *reader,
		       struct incise_camera_frame *frame,
		       struct incise_frames_stored *stored, struct incise_error *err);

void incise_frames_reader_close(struct incise_frames_reader *reader);

/* --- module ------------------------------------------------------------------------ */

#define INCISE_FRAMES_ABI 2
#define INCISE_FRAMES_SYMBOL "incise_frames"

/* What frames_mkv.so exports. */
struct incise_frames_module {
	unsigned int abi;
	struct incise_frames_writer *(*create)(
		const char *path, const struct incise_frames_shape *shape,
		const struct incise_frames_options *options, struct incise_error *err);
	struct incise_frames_reader *(*open)(const char *path, struct incise_error *err);
};

/* Bytes of a row without padding; 0: MJPEG has none. */
static inline size_t incise_frames_row(enum incise_pixels pixels, int width)
{
	switch (pixels) {
	case INCISE_PIXELS_RGB:
		return (size_t)width * 3;
	case INCISE_PIXELS_GREY:
		return (size_t)width;
	case INCISE_PIXELS_YUYV:
		return (size_t)width * 2;
	default:
		return 0;
	}
}

#endif
