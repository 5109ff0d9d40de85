// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/record/mkv/frames_mkv.c: frames come back to the byte, with their times; a file truncated
 * at any byte gives all whole frames before it; a disk that writes short, or fails; kill -9. A full disk and
 * a kill of a whole recording are in tests/attack.
 */
#include "../unit.h"
#include <signal.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <incise/backend.h>
#include <incise/rig.h>
#include "../../../lib/base/crypto/sha256.h"
#include "../../../lib/record/frames.h"
#include "../../../lib/record/write/frame_pump.h"

#define ROOM (1 << 20)
#define MS 1000000LL
#define FRAMES 20

/* --- made-up frames ------------------------------------------------------------------ */

#define FILM_FROM_NS 5000000000LL /* of the clock, when the first is taken */
#define FILM_STEP_NS 16666667LL

/* The same bytes for the same number: smooth in places, noise in others. */
static uint8_t film_byte(uint64_t n, size_t i)
{
	uint64_t x = (n + 1) * 0x9e3779b97f4a7c15ULL + i * 0xbf58476d1ce4e5b9ULL;

	x ^= x >> 29;
	x *= 0x94d049bb133111ebULL;
	return (uint8_t)(i / 64 % 2 ? x >> 56 : i / 7 + n);
}

/*
 * Frame @n. Rows are @pad bytes longer than their pixels. An "MJPEG" one is of any length
 * and of bytes that no decoder would take: they must come back all the same.
 */
static struct incise_camera_frame film_frame(const struct incise_frames_shape *s,
					     uint64_t n, int pad, uint8_t *bytes)
{
	struct incise_camera_frame frame = {
		.t_ns = FILM_FROM_NS + (int64_t)n * FILM_STEP_NS,
		.seq = n,
		.width = s->width,
		.height = s->height,
		.pixels = s->pixels,
		.data = bytes,
	};

	if (s->pixels == INCISE_PIXELS_MJPEG) {
		frame.size = 1 + (n * 977) % 5000;
	} else {
		frame.stride = (int)incise_frames_row(s->pixels, s->width) + pad;
		frame.size = (size_t)frame.stride * (size_t)s->height;
	}
	for (size_t i = 0; i < frame.size; i++)
		bytes[i] = film_byte(n, i);
	return frame;
}

/* A new folder; the path of the file in it. */
static void film_path(char *path, size_t size)
{
	char folder[] = "/tmp/incise-film-XXXXXX";

	if (!mkdtemp(folder))
		abort();
	snprintf(path, size, "%s/camera.mkv", folder);
}

static void film_remove(char *path)
{
	unlink(path);
	*strrchr(path, '/') = '\0';
	rmdir(path);
}

/* --- the file ------------------------------------------------------------------------ */

static const struct incise_frames_shape shapes[] = {
	{64, 48, INCISE_PIXELS_RGB, 60},   {66, 50, INCISE_PIXELS_GREY, 60},
	{64, 48, INCISE_PIXELS_YUYV, 60},  {64, 48, INCISE_PIXELS_MJPEG, 60},
	{17, 19, INCISE_PIXELS_RGB, 0},	   {17, 16, INCISE_PIXELS_GREY, 7.5},
	{18, 17, INCISE_PIXELS_YUYV, 1e3}, {16, 8192, INCISE_PIXELS_YUYV, 30},
};

/* A disk that writes at most so much at once, or fails. 0: as it is. */
static struct {
	size_t most;
	int64_t capacity; /* bytes until it fails with EIO; below 0: for ever */
} disk = {0, -1};

ssize_t __real_write(int fd, const void *bytes, size_t n);
ssize_t __wrap_write(int fd, const void *bytes, size_t n)
{
	if (disk.capacity >= 0 && (int64_t)n > disk.capacity) {
		n = (size_t)disk.capacity;
		if (!n) {
			errno = EIO;
			return -1;
		}
	}
	if (disk.most && n > disk.most)
		n = disk.most;
	if (disk.capacity >= 0)
		disk.capacity -= (int64_t)n;
	return __real_write(fd, bytes, n);
}

static struct incise_frames_writer *begin(const char *path,
					  const struct incise_frames_shape *shape)
{
	struct incise_frames_writer *writer =
		incise_frames.create(path, shape, NULL, &err);

	succeeds(writer);
	return writer;
}

static void put(struct incise_frames_writer *writer,
		const struct incise_camera_frame *frame,
		struct incise_frames_stored *stored)
{
	succeeds(!writer->ops->put(writer, frame, stored, &err));
}

/* That @frame is frame @n of the film, row by row. */
static void is_frame(const struct incise_camera_frame *frame,
		     const struct incise_frames_shape *shape, uint64_t n, int pad)
{
	static uint8_t bytes[ROOM];
	struct incise_camera_frame want = film_frame(shape, n, pad, bytes);
	size_t row = incise_frames_row(shape->pixels, shape->width);

	assert_int_equal(frame->t_ns, want.t_ns);
	assert_int_equal(frame->seq, n);
	assert_int_equal(frame->width, shape->width);
	assert_int_equal(frame->height, shape->height);
	assert_int_equal(frame->pixels, shape->pixels);
	if (!row) {
		assert_int_equal(frame->size, want.size);
		assert_memory_equal(frame->data, want.data, want.size);
		return;
	}
	assert_int_equal(frame->stride, row);
	assert_int_equal(frame->size, row * (size_t)shape->height);
	for (int y = 0; y < shape->height; y++)
		assert_memory_equal(frame->data + row * (size_t)y,
				    want.data + want.stride * (size_t)y, row);
}

/* Number of frames of a file; all but the last are those of the film. */
static uint64_t count(const char *path, const struct incise_frames_shape *shape)
{
	struct incise_error err = {0};
	struct incise_frames_reader *reader = incise_frames.open(path, &err);
	struct incise_camera_frame frame;
	struct incise_frames_stored stored;
	uint64_t n = 0;
	int rc;

	/* Killed before there was a file. */
	if (!reader && err.code == ENOENT)
		return 0;
	succeeds(reader);
	while ((rc = reader->ops->next(reader, &frame, &stored, &err)) == 1)
		is_frame(&frame, shape, n++, 0);
	/* The last may be torn, and then says so. */
	assert_true(rc == 0 || rc == -EBADMSG);
	if (rc == -EBADMSG)
		assert_int_equal(reader->ops->next(reader, &frame, &stored, &err), 0);
	reader->ops->close(reader);
	return n;
}

/* SHA-256 of a frame in the file; that of a JPEG is the camera's. */
static void is_digest(const struct incise_camera_frame *frame,
		      const struct incise_frames_stored *stored)
{
	char hex[INCISE_SHA256_TEXT], text[INCISE_SHA256_TEXT];

	incise_sha256_text(frame->data, frame->size, hex);
	incise_sha256_hex(stored->sha256, text);
	assert_string_equal(text, hex);
}

/* Of the test that runs. */
static struct incise_camera_frame frame;
static struct incise_frames_reader *reader;
static struct incise_frames_writer *writer;
static struct incise_frames_stored stored;

TEST(comes_back_to_the_byte)
{
	static const uint8_t no_digest[INCISE_FRAMES_DIGEST];
	static uint8_t bytes[ROOM];

	for (size_t i = 0; i < sizeof(shapes) / sizeof(*shapes); i++) {
		const struct incise_frames_shape *shape = &shapes[i];
		int pad = i % 2 ? 0 : 13, frames = shape->height > 1000 ? 2 : 12;
		struct incise_frames_stored put_as[12], stored;
		struct stat before, after;
		char path[64];

		film_path(path, sizeof(path));
		writer = begin(path, shape);
		for (int n = 0; n < frames; n++) {
			frame = film_frame(shape, (uint64_t)n, pad, bytes);
			put(writer, &frame, &put_as[n]);
			/* 16.666667 ms a frame, to the nearest. */
			assert_int_equal(put_as[n].pts_ms,
					 (n * FILM_STEP_NS + 500000) / 1000000);
		}
		assert_int_equal(stat(path, &before), 0);
		assert_int_equal(writer->ops->close(writer, &err), 0);
		/* A file that is ended is no other than one that is not. */
		assert_int_equal(stat(path, &after), 0);
		assert_int_equal(after.st_size, before.st_size);
		reader = incise_frames.open(path, &err);
		succeeds(reader);
		assert_string_equal(reader->codec, shape->pixels == INCISE_PIXELS_MJPEG
							   ? "mjpeg"
							   : "magicyuv");
		for (int n = 0; n < frames; n++) {
			reader->digests = n % 2;
			assert_int_equal(reader->ops->next(reader, &frame, &stored, &err),
					 1);
			assert_memory_equal(stored.sha256,
					    n % 2 ? put_as[n].sha256 : no_digest,
					    INCISE_FRAMES_DIGEST);
			if (n % 2 && shape->pixels == INCISE_PIXELS_MJPEG)
				is_digest(&frame, &stored);
			is_frame(&frame, shape, (uint64_t)n, pad);
			assert_int_equal(stored.pts_ms, put_as[n].pts_ms);
			assert_int_equal(stored.bytes, put_as[n].bytes);
			assert_int_equal(stored.crc, put_as[n].crc);
		}
		assert_int_equal(reader->ops->next(reader, &frame, &stored, &err), 0);
		assert_int_equal(reader->ops->next(reader, &frame, &stored, &err), 0);
		reader->ops->close(reader);
		film_remove(path);
	}
}

/* Of a writer before MagicYUV: shapes 4 to 6. */
TEST(files_of_ffv1_stay_readable)
{
	static const char *const files[] = {"rgb", "grey", "yuyv"};

	for (int i = 0; i < 3; i++) {
		char path[64];

		snprintf(path, sizeof(path), "tests/unit/mkv/ffv1/%s.mkv", files[i]);
		reader = incise_frames.open(path, &err);
		succeeds(reader);
		assert_string_equal(reader->codec, "ffv1");
		reader->ops->close(reader);
		assert_int_equal(count(path, &shapes[4 + i]), 2);
	}
}

/* Times that no camera should give: what is noted is exact, pts goes on. */
TEST(any_time_is_kept)
{
	static const struct {
		int64_t t_ns, pts_ms;
	} row[] = {
		{1000, 0},
		{1000, 1}, /* again */
		{1500000 + 1000, 2},
		{2499999 + 1000, 3}, /* 2 is taken */
		{999, 4},	     /* before the first */
		{INT64_MIN, 5},
		{100499999 + 1000, 100},
		{100500000 + 1000, 101},
		{7200000000000LL + 1000, 7200000}, /* two hours on: one cluster each */
	};
	const struct incise_frames_shape *shape = &shapes[3];
	uint8_t bytes[6000];
	char path[64];

	film_path(path, sizeof(path));
	writer = begin(path, shape);
	for (size_t i = 0; i < sizeof(row) / sizeof(*row); i++) {
		frame = film_frame(shape, i, 0, bytes);
		frame.t_ns = row[i].t_ns;
		frame.seq = UINT64_MAX - i;
		put(writer, &frame, &stored);
		assert_int_equal(stored.pts_ms, row[i].pts_ms);
	}
	assert_int_equal(writer->ops->close(writer, NULL), 0);
	reader = incise_frames.open(path, NULL);
	assert_non_null(reader);
	for (size_t i = 0; i < sizeof(row) / sizeof(*row); i++) {
		assert_int_equal(reader->ops->next(reader, &frame, &stored, NULL), 1);
		assert_true(frame.t_ns == row[i].t_ns);
		assert_true(frame.seq == UINT64_MAX - i);
		assert_int_equal(stored.pts_ms, row[i].pts_ms);
	}
	reader->ops->close(reader);
	film_remove(path);
}

TEST(refuses)
{
	static const struct incise_frames_shape none[] = {
		{15, 48, INCISE_PIXELS_GREY, 60},	{48, 15, INCISE_PIXELS_MJPEG, 60},
		{8194, 48, INCISE_PIXELS_RGB, 60},	{65, 48, INCISE_PIXELS_YUYV, 60},
		{64, 48, (enum incise_pixels)9, 0},	{64, 48, INCISE_PIXELS_RGB, -1},
		{64, 48, INCISE_PIXELS_RGB, 0.0 / 0.0},
	};
	static uint8_t bytes[ROOM];
	char path[64];

	film_path(path, sizeof(path));
	for (size_t i = 0; i < sizeof(none) / sizeof(*none); i++) {
		errno = 0;
		assert_null(incise_frames.create(path, &none[i], NULL, &err));
		assert_int_equal(errno, EINVAL);
	}
	assert_null(incise_frames.open(path, &err));
	assert_int_equal(err.code, ENOENT);
	writer = begin(path, &shapes[0]);
	errno = 0;
	assert_null(incise_frames.create(path, &shapes[0], NULL, &err));
	assert_int_equal(errno, EEXIST);
	for (int i = 0; i < 5; i++) {
		frame = film_frame(&shapes[0], 0, 0, bytes);
		if (i == 0)
			frame.width--;
		else if (i == 1)
			frame.pixels = INCISE_PIXELS_GREY;
		else if (i == 2)
			frame.size--;
		else if (i == 3)
			frame.stride--;
		else
			frame.data = NULL;
		assert_int_equal(writer->ops->put(writer, &frame, &stored, &err),
				 -EINVAL);
	}
	/* That did it no harm. */
	frame = film_frame(&shapes[0], 0, 0, bytes);
	put(writer, &frame, &stored);
	assert_int_equal(writer->ops->close(writer, &err), 0);
	assert_int_equal(count(path, &shapes[0]), 1);
	film_remove(path);
}

/* Where each frame ends in the file. */
static void write_film(const char *path, const struct incise_frames_shape *shape, int n,
		       off_t *ends)
{
	struct incise_frames_writer *writer = begin(path, shape);
	static uint8_t bytes[ROOM];
	struct stat st;

	for (int i = 0; i < n; i++) {
		struct incise_camera_frame frame =
			film_frame(shape, (uint64_t)i, 0, bytes);
		struct incise_frames_stored stored;

		put(writer, &frame, &stored);
		assert_int_equal(stat(path, &st), 0);
		ends[i] = st.st_size;
	}
	assert_int_equal(writer->ops->close(writer, NULL), 0);
}

TEST(cut_off_anywhere)
{
	for (size_t i = 0; i < 4; i++) {
		off_t ends[6];
		char path[64];

		film_path(path, sizeof(path));
		write_film(path, &shapes[i], 6, ends);
		/* From the back, so that one file will do; 61 meets every kind of place. */
		for (off_t size = ends[5]; size >= 0; size -= 61) {
			uint64_t whole = 0, found;

			assert_int_equal(truncate(path, size), 0);
			while (whole < 6 && ends[whole] <= size)
				whole++;
			found = count(path, &shapes[i]);
			/* Bytes behind the frame's need not exist. */
			assert_in_range(found, whole, whole + 1);
		}
		film_remove(path);
	}
}

TEST(altered_bytes_are_found)
{
	/* decoded, and by the CRC alone */
	for (size_t i = 0; i < 8; i++) {
		const struct incise_frames_shape *shape = &shapes[i % 4];
		bool undecoded = i >= 4 && shape->pixels != INCISE_PIXELS_MJPEG;
		off_t ends[6];
		char path[64];
		FILE *file;

		film_path(path, sizeof(path));
		write_film(path, shape, 6, ends);
		file = fopen(path, "r+");
		assert_non_null(file);
		/* In the middle of frame 3's bytes. */
		assert_int_equal(fseek(file, (ends[2] + ends[3]) / 2, SEEK_SET), 0);
		int c = fgetc(file);
		assert_int_equal(fseek(file, -1, SEEK_CUR), 0);
		fputc(c ^ 1, file);
		fclose(file);
		reader = incise_frames.open(path, NULL);
		assert_non_null(reader);
		reader->undecoded = i >= 4;
		for (uint64_t n = 0; n < 6; n++) {
			int rc = reader->ops->next(reader, &frame, &stored, &err);

			assert_int_equal(rc, n == 3 ? -EBADMSG : 1);
			assert_int_equal(frame.seq, n);
			assert_int_equal(!frame.data, n == 3 || undecoded);
		}
		assert_int_equal(reader->ops->next(reader, &frame, &stored, NULL), 0);
		reader->ops->close(reader);
		film_remove(path);
	}
}

/* Any byte may be any: it must come to an end, and a sanitizer have nothing to say. */
TEST(noise_ends)
{
	for (uint64_t round = 0; round < 60; round++) {
		const struct incise_frames_shape *shape = &shapes[round % 4];
		off_t ends[3];
		char path[64];
		FILE *file;
		int steps = 0;

		film_path(path, sizeof(path));
		write_film(path, shape, 3, ends);
		file = fopen(path, "r+");
		assert_non_null(file);
		for (size_t k = 0; k < 1 + round % 5; k++) {
			/* The headers more often than what is behind them. */
			off_t end = round % 3 ? 600 : ends[2];

			fseek(file, (round * 7919 + k * 104729) % end, SEEK_SET);
			fputc(film_byte(round, 64 + k), file);
		}
		fclose(file);
		reader = incise_frames.open(path, NULL);
		while (reader && steps++ < 100) {
			int rc = reader->ops->next(reader, &frame, &stored, NULL);

			if (rc != 1 && rc != -EBADMSG)
				break;
		}
		assert_true(steps < 100);
		if (reader)
			reader->ops->close(reader);
		film_remove(path);
	}
}

TEST(short_writes_are_gone_on_with)
{
	off_t ends[6];
	char path[64];

	film_path(path, sizeof(path));
	disk.most = 100;
	write_film(path, &shapes[0], 6, ends);
	disk.most = 0;
	assert_int_equal(count(path, &shapes[0]), 6);
	film_remove(path);
}

/* Wherever it fails, what was put before is there, and the rest is cut off. */
TEST(a_disk_that_fails)
{
	static uint8_t bytes[ROOM];

	for (int64_t capacity = 0; capacity < 20000; capacity += 777) {
		struct incise_error err = {0};
		uint64_t n = 0;
		char path[64];
		int rc = 0;

		film_path(path, sizeof(path));
		disk.capacity = capacity;
		writer = incise_frames.create(path, &shapes[3], NULL, &err);
		while (writer && !rc && n < 100) {
			struct incise_camera_frame frame =
				film_frame(&shapes[3], n++, 0, bytes);

			rc = writer->ops->put(writer, &frame, &stored, &err);
		}
		disk.capacity = -1;
		assert_int_equal(err.code, EIO);
		if (!writer) {
			/* Nothing is left of a file that could not be started. */
			assert_int_equal(access(path, F_OK), -1);
			film_remove(path);
			continue;
		}
		assert_int_equal(rc, -EIO);
		assert_int_equal(writer->ops->close(writer, &err), -EIO);
		assert_int_equal(count(path, &shapes[3]), n - 1);
		film_remove(path);
	}
}

/* 20 writers are killed, each after a number of frames: every frame that was put is there. */
TEST(killed)
{
	volatile uint64_t *done = mmap(NULL, 4096, PROT_READ | PROT_WRITE,
				       MAP_SHARED | MAP_ANONYMOUS, -1, 0);

	assert_true(done != MAP_FAILED);
	for (int round = 0; round < 20; round++) {
		const struct incise_frames_shape *shape = &shapes[round % 4];
		uint64_t was, found;
		char path[64];
		pid_t child;

		film_path(path, sizeof(path));
		*done = 0;
		child = fork();
		assert_true(child >= 0);
		if (!child) {
			struct incise_frames_writer *writer =
				incise_frames.create(path, shape, NULL, NULL);
			static uint8_t bytes[ROOM];

			for (uint64_t n = 0; writer; n++) {
				struct incise_camera_frame frame =
					film_frame(shape, n, 0, bytes);

				if (writer->ops->put(writer, &frame, &stored, NULL))
					break;
				*done = n + 1;
			}
			_exit(1);
		}
		while (*done < (uint64_t)round && !waitpid(child, NULL, WNOHANG))
			usleep(100);
		usleep((useconds_t)(round * 37 % 20) * 100);
		assert_int_equal(kill(child, SIGKILL), 0);
		assert_int_equal(waitpid(child, NULL, 0), child);
		was = *done;
		found = count(path, shape);
		/* The one that was on its way may be there or not. */
		assert_in_range(found, was, was + 1);
		film_remove(path);
	}
	munmap((void *)done, 4096);
}

/* --- the pump and the file ----------------------------------------------------------- */

TEST(virtual_camera_comes_back)
{
	struct incise_rig *rig =
		incise_rig_open("sim:clock=simulated", INCISE_RIG_CAMERA, NULL);
	struct incise_frame_record record[FRAMES];
	struct incise_frame_pump_setup setup = {0};
	struct incise_frames_shape shape;
	struct incise_camera_info info;
	struct incise_frame_pump *pump;
	int64_t from_ns;
	char path[64];
	int read = 0;

	assert_non_null(rig);
	film_path(path, sizeof(path));
	setup.camera = incise_rig_camera(rig);
	setup.clock = incise_rig_clock(rig);
	incise_camera_info(setup.camera, &info);
	shape = (struct incise_frames_shape){info.width, info.height, info.pixels,
					     info.rate_hz};
	setup.writer = incise_frames.create(path, &shape, NULL, NULL);
	assert_non_null(setup.writer);
	pump = incise_frame_pump_new(&setup, NULL);
	assert_non_null(pump);
	from_ns = incise_clock_now(setup.clock);
	for (int ms = 0; read < FRAMES; ms++) {
		incise_clock_wait_until(setup.clock, from_ns + ms * MS);
		read += incise_frame_pump_step(pump);
	}
	assert_int_equal(incise_frame_pump_stop(pump, 60000 * MS, NULL), 0);
	assert_int_equal(incise_frame_pump_take(pump, record, FRAMES), FRAMES);
	incise_frame_pump_free(pump);
	incise_rig_close(rig);

	/* The same world once more, which is a function of its clock. */
	rig = incise_rig_open("sim:clock=simulated", INCISE_RIG_CAMERA, NULL);
	reader = incise_frames.open(path, &err);
	assert_true(rig && reader);
	for (int i = 0; i < FRAMES; i++) {
		struct incise_camera_frame truth;

		incise_clock_wait_until(incise_rig_clock(rig), record[i].arrival_ns);
		assert_int_equal(incise_camera_read(incise_rig_camera(rig), &truth), 1);
		assert_int_equal(reader->ops->next(reader, &frame, &stored, &err), 1);
		assert_int_equal(frame.seq, record[i].seq);
		assert_int_equal(frame.t_ns, record[i].t_ns);
		assert_int_equal(frame.t_ns, truth.t_ns);
		assert_int_equal(stored.pts_ms, record[i].pts_ms);
		assert_int_equal(stored.bytes, record[i].bytes);
		assert_int_equal(stored.crc, record[i].crc);
		assert_int_equal(frame.size, truth.size);
		assert_memory_equal(frame.data, truth.data, truth.size);
	}
	assert_int_equal(reader->ops->next(reader, &frame, &stored, &err), 0);
	reader->ops->close(reader);
	incise_rig_close(rig);
	film_remove(path);
}
