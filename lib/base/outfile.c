// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Files that appear whole or not at all; see incise/outfile.h.
 */
#include <errno.h>
#include <fcntl.h>
#include <libgen.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <incise/outfile.h>

/* Names to try before giving up: more writers of one file at once there will not be. */
#define TRIES 100

struct incise_outfile {
	char *path;   /* as given, for messages */
	char *target; /* where it leads */
	char *temp;   /* hidden name beside path; NULL when written directly */
	bool linked;  /* temp exists in the file system */
	FILE *stream;
};

static void outfile_free(struct incise_outfile *file)
{
	free(file->path);
	free(file->target);
	free(file->temp);
	free(file);
}

/* ".NAME.XXXXXX" in the folder of path: rename(2) does not cross file systems. */
static char *temp_name(const char *path)
{
	const char *slash = strrchr(path, '/');
	int dir = slash ? (int)(slash - path) + 1 : 0;
	char *name = NULL;

	if (asprintf(&name, "%.*s.%s.XXXXXX", dir, path, path + dir) < 0)
		return NULL;
	return name;
}

/* The hidden name for a try: ".NAME.123456". */
static void try_name(struct incise_outfile *file, unsigned int n)
{
	snprintf(strrchr(file->temp, '.') + 1, 7, "%06u",
		 ((unsigned int)getpid() + n) % 1000000u);
}

static int open_temp(struct incise_outfile *file)
{
	char *dir = strdup(file->temp);
	int fd;

	if (!dir)
		return -1;
	fd = open(dirname(dir), O_TMPFILE | O_WRONLY | O_CLOEXEC, 0666);
	free(dir);
	for (unsigned int n = 0; fd < 0 && n < TRIES; n++) {
		try_name(file, n);
		fd = open(file->temp, O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC, 0666);
		file->linked = fd >= 0;
		if (fd < 0 && errno != EEXIST)
			break;
	}
	return fd;
}

/*
 * Give the new file the mode, owner and group of the one that it replaces, before it has any
 * content. Only root may keep another's owner. Where the group cannot be kept either, the
 * writer's own group gets no more than all users have.
 */
static int keep_access(int fd, const struct stat *old)
{
	mode_t mode = old->st_mode & 0777;
	struct stat st;

	if (fchown(fd, old->st_uid, old->st_gid) && fchown(fd, -1, old->st_gid))
		mode &= ~(mode_t)070 | (mode & 07) << 3;
	if (fstat(fd, &st))
		return -1;
	return (st.st_mode & 07777) == mode ? 0 : fchmod(fd, mode);
}

struct incise_outfile *incise_outfile_open(const char *path, struct incise_error *err)
{
	struct incise_outfile *file = calloc(1, sizeof(*file));
	struct stat st;
	bool exists;
	int fd;

	if (!file)
		goto fail;
	file->path = strdup(path);
	/*
	 * A link is written through, not replaced; a link that leads nowhere is an error.
	 * /dev/stdout may lead to a pipe, which has no path, but is there.
	 */
	exists = !stat(path, &st);
	file->target = realpath(path, NULL);
	if (!file->target && !exists && !lstat(path, &st) && S_ISLNK(st.st_mode)) {
		errno = ENOENT;
		goto fail;
	}
	if (!file->target)
		file->target = strdup(path);
	if (!file->path || !file->target)
		goto fail;
	if (!strcmp(path, "-")) {
		file->stream = stdout;
		return file;
	}
	if (!*path || (exists && S_ISDIR(st.st_mode))) {
		errno = *path ? EISDIR : ENOENT;
		goto fail;
	}
	if (exists && !S_ISREG(st.st_mode)) {
		fd = open(path, O_WRONLY | O_CLOEXEC);
	} else {
		file->temp = temp_name(file->target);
		fd = file->temp ? open_temp(file) : -1;
	}
	if (fd < 0)
		goto fail;
	if ((file->temp && exists && keep_access(fd, &st)) ||
	    !(file->stream = fdopen(fd, "w"))) {
		int code = errno;

		close(fd);
		if (file->linked)
			unlink(file->temp);
		errno = code;
		goto fail;
	}
	return file;
fail:
	incise_error_set(err, errno, "%s: cannot be written: %s; give another path", path,
			 strerror(errno));
	if (file) {
		fd = errno;
		outfile_free(file);
		errno = fd;
	}
	return NULL;
}

FILE *incise_outfile_stream(struct incise_outfile *file)
{
	return file->stream;
}

/* Give the nameless file a hidden name, so that rename(2) can put it in its place. */
static int link_temp(struct incise_outfile *file, int fd)
{
	char proc[32];

	if (file->linked)
		return 0;
	snprintf(proc, sizeof(proc), "/proc/self/fd/%d", fd);
	for (unsigned int n = 0; n < TRIES; n++) {
		try_name(file, n);
		if (!linkat(AT_FDCWD, proc, AT_FDCWD, file->temp, AT_SYMLINK_FOLLOW)) {
			file->linked = true;
			return 0;
		}
		if (errno != EEXIST)
			break;
	}
	return -errno;
}

int incise_outfile_commit(struct incise_outfile *file, struct incise_error *err)
{
	int fd = fileno(file->stream);
	int rc = 0;

	if (ferror(file->stream) || fflush(file->stream))
		rc = errno ? -errno : -EIO;
	if (!rc && file->temp && fsync(fd))
		rc = -errno;
	if (!rc && file->temp)
		rc = link_temp(file, fd);
	if (!rc && file->temp && rename(file->temp, file->target))
		rc = -errno;
	if (rc) {
		rc = incise_error_set(err, -rc, "%s: not written: %s%s",
				      strcmp(file->path, "-") ? file->path
							      : "standard output",
				      strerror(-rc),
				      file->temp && !access(file->target, F_OK)
					      ? "; the previous file is unchanged"
					      : "");
		incise_outfile_abort(file);
		return rc;
	}
	if (file->stream != stdout)
		fclose(file->stream);
	outfile_free(file);
	return 0;
}

void incise_outfile_abort(struct incise_outfile *file)
{
	if (!file)
		return;
	if (file->stream != stdout)
		fclose(file->stream);
	if (file->linked)
		unlink(file->temp);
	outfile_free(file);
}
