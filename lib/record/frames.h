/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Frames of a camera in a file, NAME.rec/camera.mkv: Matroska with one video track, MJPEG as
 * the camera sent it or lossless MagicYUV. A module on libavformat, frames_mkv.so, writes and reads
 * it; it is loaded at first use and stays loaded.
 *
 *     camera ─► pump (frame_pump.h) ─► writer ─► camera.mkv ─► reader
 *
 * In the file:
 *   * one cluster per frame, whole in the kernel when put() returns: a kill costs no
 *     frame that was put. There is no index and nothing is patched in at the end, so a
 *     truncated file has the form of a whole one.
 *   * the time of a block is ms after the first frame: Matroska's usual scale, and the one
 *     that libavformat writes. It is t_ns to ± 0.5 ms; where frames are closer than 1 ms
 *     it steps by 1 ms. The exact time is in
 *   * BlockAdditional 1, 24 bytes, big-endian, which players ignore:
 *       0  'I' 'N' 'C' 1      4  CRC-32 (as zlib's) of the block's bytes
 *       8  t_ns, of CLOCK_MONOTONIC, signed      16  seq
 *   * MagicYUV: YUYV is yuv422p in it, grey gray8, RGB gbrp. It takes a seventh of the time of
 *     FFV1, which falls behind 640 × 480 at 100 Hz, and a sixth more space. Before, it was FFV1
 *     (version 3, intra only, 4 slices with a CRC each; RGB bgr0), which is read as well.
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
#define INCISE_FRAMES_BYTES_MAX ((size_t)1 << 28) /* of a frame: 8192² RGB fits */

#define INCISE_FRAMES_DIGEST 32 /* bytes: SHA-256 of a frame in the file */

/* The form of all frames of a file. YUYV has an even width. */
struct incise_frames_shape {
	int width, height;
	enum incise_pixels pixels;
	double rate_hz; /* a hint to players; 0: none */
};

struct incise_frames_options {
	int64_t sync_ns; /* between two fdatasync(2) in put(); 0: in close() only */
};

/* A frame in the file. */
struct incise_frames_stored {
	int64_t pts_ms; /* unique, ascending */
	uint32_t bytes;
	uint32_t crc; /* CRC-32 of them */
	uint8_t sha256[INCISE_FRAMES_DIGEST];
};

/* A row of the table frames: a frame in the file, and vision's result. */
struct incise_frame_record {
	uint64_t seq;
	int64_t t_ns, arrival_ns;
	int64_t pts_ms;
	uint32_t bytes, crc;
	uint8_t sha256[INCISE_FRAMES_DIGEST];
	/* By vision. NaN: not looked at, or no handle found (then the quality is 0). */
	double length_px, sd_px, depth_mm, quality;
};

/* --- writer ------------------------------------------------------------------------ */

struct incise_frames_writer;

struct incise_frames_writer_ops {
	int (*put)(struct incise_frames_writer *writer,
		   const struct incise_camera_frame *frame,
		   struct incise_frames_stored *stored, struct incise_error *err);
	int (*close)(struct incise_frames_writer *writer, struct incise_error *err);
};

/* For one thread at a time. Blocks as long as the disk does. */
struct incise_frames_writer {
	const struct incise_frames_writer_ops *ops;
};

/*
 * Create a file, which must not exist.
 * NULL with errno: EINVAL (an impossible shape), EEXIST, ENOMEM, those of open(2) and
 * write(2), and ENOENT, ENOEXEC (the module).
 */
struct incise_frames_writer *incise_frames_writer_new(
	const char *path, const struct incise_frames_shape *shape,
	const struct incise_frames_options *options, struct incise_error *err);

/*
 * 0: the frame is in the kernel, and a kill does not lose it. -EINVAL: it is not of the
 * shape; the next one may be. Any other error (-ENOSPC, -EIO, …) ends the file behind the last
 * frame that was put, and every further call returns the same error.
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

/* For one thread at a time. */
struct incise_frames_reader {
	const struct incise_frames_reader_ops *ops;
	/* May be set between two frames: lossless frames are not decoded, which saves their time, and
	 * frames have no data. Their CRC is still checked. */
	bool undecoded;
	/* And so may this: stored frames come with their digest, which is 0 otherwise. */
	bool digests;
	const char *codec; /* "magicyuv", "ffv1" or "mjpeg"; NULL: there is no frame */
};

/*
 * Open a file, which may be truncated or still grow. NULL with errno: EINVAL (not a file of
 * this kind), ENOMEM, those of open(2), and ENOENT, ENOEXEC (the module).
 */
struct incise_frames_reader *incise_frames_reader_new(const char *path,
						      struct incise_error *err);

/*
 * Read the next frame as it was put, without row padding; its bytes are valid until the next
 * call. 1; 0 at the end, also that of a truncated file; -EBADMSG: an altered frame (with t_ns
 * and seq of the file, data NULL), and the next may be read; -EIO, -ENOMEM.
 */
int incise_frames_next(struct incise_frames_reader *reader,
		       struct incise_camera_frame *frame,
		       struct incise_frames_stored *stored, struct incise_error *err);

void incise_frames_reader_close(struct incise_frames_reader *reader);

/* --- module ------------------------------------------------------------------------ */

#define INCISE_FRAMES_ABI 4
#define INCISE_FRAMES_SYMBOL "incise_frames"

struct incise_frames_module {
	unsigned int abi;
	struct incise_frames_writer *(*create)(
		const char *path, const struct incise_frames_shape *shape,
		const struct incise_frames_options *options, struct incise_error *err);
	struct incise_frames_reader *(*open)(const char *path, struct incise_error *err);
};

/* Exported by frames_mkv.so. */
INCISE_API extern const struct incise_frames_module incise_frames;

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
