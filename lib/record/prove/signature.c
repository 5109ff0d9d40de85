// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Signatures of OpenSSH over a text: ssh-keygen makes and checks them, so that its agent, hardware
 * keys, certificates and files of allowed signers work here as they do there. It is run without a
 * shell. It reads all that is not trusted from files in memory, whose names are not those of a recording.
 */
#include <errno.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>
#include <incise/infile.h>
#include "../../base/control_character.h"
#include "prove.h"

#define NAMESPACE "incise" /* the purpose that a signature is for */
#define SIGNERS_MAX (1024 * 1024)
#define ANSWER_MAX (2 * INCISE_SIGNATURE_MAX)

/* A file in memory with these bytes, to be read from its start; -1 with errno. */
static int make_file(const char *bytes, size_t n)
{
	int fd = memfd_create("seal", MFD_CLOEXEC);

	if (fd >= 0 && pwrite(fd, bytes, n, 0) != (ssize_t)n) {
		close(fd);
		return -1;
	}
	return fd;
}

/* The text that a program wrote there, of at most ANSWER_MAX bytes. Closes it. */
static char *take_answer(int fd)
{
	char *text = fd < 0 ? NULL : calloc(ANSWER_MAX + 1, 1);

	if (text && pread(fd, text, ANSWER_MAX, 0) < 0)
		*text = 0;
	if (fd >= 0)
		close(fd);
	return text;
}

/* Files that ssh-keygen reads by their paths. */
enum file { SIGNATURE, SIGNERS, REVOKED, FILES };

struct check {
	int fd[FILES]; /* -1: none */
	char path[FILES][32];
	char at[40]; /* "-Overify-time=…" */
	const struct incise_bytes *text;
};

struct keygen {
	bool good;    /* exit status 0 */
	char *out;    /* standard output */
	char *errors; /* "" if they went to the terminal */
};

static void free_keygen(struct keygen *keygen)
{
	free(keygen->out);
	free(keygen->errors);
}

/* Its status as of waitpid(2); -1 with errno. The descriptors are in ascending order. */
static int spawn_keygen(char *const argv[], const int fd[3], const struct check *check)
{
	posix_spawn_file_actions_t actions;
	int status, code = posix_spawn_file_actions_init(&actions);
	pid_t pid;

	for (int i = 0; i < 3 && !code; i++)
		code = posix_spawn_file_actions_adddup2(&actions, fd[i], i);
	/* Onto itself: it stays open. */
	for (int i = 0; check && i < FILES && !code; i++)
		if (check->fd[i] >= 0)
			code = posix_spawn_file_actions_adddup2(&actions, check->fd[i],
								check->fd[i]);
	if (!code)
		code = posix_spawnp(&pid, argv[0], &actions, NULL, argv, environ);
	posix_spawn_file_actions_destroy(&actions);
	while (!code && waitpid(pid, &status, 0) != pid)
		code = errno == EINTR ? 0 : errno;
	errno = code;
	return code ? -1 : status;
}

/* Run it on a text. @check: or NULL; then it may ask on the terminal. Returns 0 or -errno. */
static int run_keygen(struct keygen *keygen, char *const argv[],
		      const struct incise_bytes *text, const struct check *check,
		      struct incise_error *err)
{
	int fd[] = {make_file(text->bytes, text->n), make_file("", 0), make_file("", 0)};
	bool asks = !check && isatty(STDERR_FILENO),
	     made = fd[0] >= 0 && fd[1] >= 0 && fd[2] >= 0;
	int all[] = {fd[0], fd[1], asks ? STDERR_FILENO : fd[2]};
	int status = made ? spawn_keygen(argv, all, check) : -1, code = errno;

	if (fd[0] >= 0)
		close(fd[0]);
	keygen->out = take_answer(fd[1]);
	keygen->errors = take_answer(fd[2]);
	keygen->good = status >= 0 && WIFEXITED(status) && !WEXITSTATUS(status);
	if (status >= 0 && keygen->out && keygen->errors)
		return 0;
	free_keygen(keygen);
	*keygen = (struct keygen){0};
	if (status >= 0 || !made)
		return incise_error_set(err, ENOMEM, "ssh-keygen: out of memory");
	return incise_error_set(err, code,
				"ssh-keygen: %s; apt-get install openssh-client",
				strerror(code));
}

/* The last line of a text that is not empty, in place. */
static char *find_last_line(char *text)
{
	char *line = text;

	for (char *end = text + strlen(text); end > text && strchr("\r\n", end[-1]);)
		*--end = 0;
	for (char *at; (at = strpbrk(line, "\r\n"));)
		line = at + 1;
	return line;
}

/* --- making one ------------------------------------------------------------------------ */

/* ssh-keygen would wait for the writer of a pipe, or read a device for ever. */
static int check_key(const char *key, struct incise_error *err)
{
	struct stat st;

	if (stat(key, &st))
		return incise_error_set(err, errno,
					"%s: %s; give a private key, or the public key "
					"of one in the agent",
					key, strerror(errno));
	if (!S_ISREG(st.st_mode) || st.st_size > INCISE_SIGNATURE_MAX)
		return incise_error_set(
			err, EINVAL,
			"%s: not the file of a key; give a private key, or "
			"the public key of one in the agent",
			key);
	return 0;
}

int incise_signature_make(const char *key, const struct incise_bytes *text,
			  struct incise_bytes *signature, struct incise_error *err)
{
	char *argv[] = {"ssh-keygen", "-Y", "sign",    "-q", "-f",
			(char *)key,  "-n", NAMESPACE, NULL};
	struct keygen keygen;
	int rc = check_key(key, err);

	if (!rc)
		rc = run_keygen(&keygen, argv, text, NULL, err);
	if (rc)
		return rc;
	if (keygen.good && strlen(keygen.out) <= INCISE_SIGNATURE_MAX &&
	    !strncmp(keygen.out, "-----BEGIN SSH SIGNATURE-----", 29)) {
		free(keygen.errors);
		*signature = (struct incise_bytes){keygen.out, strlen(keygen.out)};
		return 0;
	}
	rc = incise_error_set(err, EACCES,
			      "%s: ssh-keygen did not sign with this key%s%.200s", key,
			      *keygen.errors ? ": " : "", find_last_line(keygen.errors));
	free_keygen(&keygen);
	return rc;
}

/* --- checking one ---------------------------------------------------------------------- */

static const struct incise_infile_kind signers_kind = {
	.name = "a file of signers",
	.advice = "give a file of allowed signers, see ssh-keygen(1)",
	.size_max = SIGNERS_MAX,
};

static const struct incise_infile_kind revoked_kind = {
	.name = "a file of revoked keys",
	.advice = "give public keys, or a list of ssh-keygen -k",
	.size_max = SIGNERS_MAX,
};

int incise_signers_read(struct incise_signers *signers, const char *path,
			const char *revoked, struct incise_error *err)
{
	struct incise_bytes *allowed = &signers->allowed;

	*signers = (struct incise_signers){0};
	allowed->bytes = incise_infile_read(path, &signers_kind, &allowed->n, err);
	if (allowed->bytes && revoked)
		signers->revoked.bytes = incise_infile_read(revoked, &revoked_kind,
							    &signers->revoked.n, err);
	return !allowed->bytes || (revoked && !signers->revoked.bytes) ? -errno : 0;
}

void incise_signers_free(struct incise_signers *signers)
{
	free(signers->allowed.bytes);
	free(signers->revoked.bytes);
}

/* Copy text that ssh-keygen printed, which may hold anything. */
static void copy_text(char *to, size_t size, const char *text, size_t n)
{
	n = strnlen(text, n < size ? n : size - 1);
	memcpy(to, text, n);
	to[n] = 0;
	control_characters_hide(to);
}

/* "Good "incise" signature with ED25519 key SHA256:…": what is behind "with", without "key". */
static void copy_key(struct incise_proof_voucher *voucher, char *line)
{
	char *with = strstr(line, " with "), *key = with ? strstr(with, " key ") : NULL;

	if (!key)
		return;
	line[strcspn(line, "\r\n")] = 0;
	memmove(key + 1, key + 5, strlen(key + 5) + 1);
	copy_text(voucher->key, sizeof(voucher->key), with + 6, sizeof(voucher->key));
}

/* The reason that ssh-keygen gives, "PATH:1: key has expired: …", without its path. */
static void copy_reason(struct incise_proof_voucher *voucher, const char *errors,
			const char *otherwise)
{
	static const char *const reasons[] = {"key has expired", "key is not yet valid",
					      "key is not permitted"};

	for (size_t i = 0; i < sizeof(reasons) / sizeof(*reasons); i++) {
		const char *reason = strstr(errors, reasons[i]);

		if (!reason)
			continue;
		copy_text(voucher->why, sizeof(voucher->why), reason,
			  strcspn(reason, "\r\n"));
		return;
	}
	snprintf(voucher->why, sizeof(voucher->why), "%s", otherwise);
}

static void print_time(char *text, size_t size, int64_t at_s)
{
	time_t t = at_s;
	struct tm tm;

	if (gmtime_r(&t, &tm))
		strftime(text, size, "-Overify-time=%Y%m%d%H%M%SZ", &tm);
}

/* Whether the signer may have made it: *good, else the reason. Returns 0 or -errno. */
static int check_signer(struct check *check, struct incise_proof_voucher *voucher,
			char *signer, bool revoked, bool *good, struct incise_error *err)
{
	char *argv[] = {"ssh-keygen",
			"-Y",
			"verify",
			"-n",
			NAMESPACE,
			"-s",
			check->path[SIGNATURE],
			"-f",
			check->path[SIGNERS],
			"-I",
			signer,
			check->at,
			revoked ? "-r" : NULL,
			check->path[REVOKED],
			NULL};
	struct keygen keygen;
	int rc = run_keygen(&keygen, argv, check->text, check, err);

	*good = !rc && keygen.good;
	if (!rc && !*good)
		copy_reason(voucher, keygen.errors,
			    "its key is not allowed to sign this");
	free_keygen(&keygen);
	if (rc || *good || !revoked)
		return rc;
	/* It gives no reason if a key is revoked: then this alone makes the difference. */
	rc = check_signer(check, voucher, signer, false, good, err);
	if (!rc && *good)
		strcpy(voucher->why,
		       "its key is revoked, or the file of revoked keys is not valid");
	*good = false;
	return rc;
}

/* The same for all that may have made it by their keys. */
static int check_signers(struct check *check, struct incise_proof_voucher *voucher,
			 struct incise_error *err)
{
	char *argv[] = {"ssh-keygen",
			"-Y",
			"find-principals",
			"-s",
			check->path[SIGNATURE],
			"-f",
			check->path[SIGNERS],
			check->at,
			NULL};
	struct keygen keygen;
	bool good = false;
	int rc = run_keygen(&keygen, argv, &(struct incise_bytes){"", 0}, check, err);

	if (!rc && !keygen.good)
		copy_reason(voucher, keygen.errors, "no signer has its key");
	for (char *save,
	     *signer = keygen.good ? strtok_r(keygen.out, "\r\n", &save) : NULL;
	     signer && !good && !rc; signer = strtok_r(NULL, "\r\n", &save)) {
		/* Signers that a pattern leaves out are listed, too. */
		if (*signer == '!')
			continue;
		rc = check_signer(check, voucher, signer, check->fd[REVOKED] >= 0, &good,
				  err);
		if (!good)
			continue;
		voucher->verdict = INCISE_PROOF_GOOD;
		*voucher->why = 0;
		/* A pattern names no one person. */
		snprintf(voucher->by, sizeof(voucher->by), "%s%s",
			 strpbrk(signer, "*?") ? "one of " : "", signer);
		control_characters_hide(voucher->by);
	}
	free_keygen(&keygen);
	return rc;
}

/* Whether it is a signature over the text, by whatever key. Returns 0 or -errno. */
static int check_text(struct check *check, struct incise_proof_voucher *voucher,
		      struct incise_error *err)
{
	char *argv[] = {"ssh-keygen", "-Y", "check-novalidate",	    "-n",
			NAMESPACE,    "-s", check->path[SIGNATURE], NULL};
	struct keygen keygen;
	int rc = run_keygen(&keygen, argv, check->text, check, err);

	if (rc)
		return rc;
	voucher->verdict = keygen.good ? INCISE_PROOF_UNCHECKED : INCISE_PROOF_BAD;
	if (keygen.good)
		copy_key(voucher, keygen.out);
	else
		snprintf(voucher->why, sizeof(voucher->why), "%s",
			 strstr(keygen.errors, "namespace")
				 ? "it is a signature for another purpose"
			 : strstr(keygen.errors, "incorrect signature")
				 ? "it is a signature over another statement"
				 : "it is no signature of OpenSSH");
	free_keygen(&keygen);
	return 0;
}

int incise_signature_check(struct incise_proof_voucher *voucher,
			   const struct incise_bytes *text,
			   const struct incise_bytes *signature,
			   const struct incise_signers *signers, int64_t at_s,
			   struct incise_error *err)
{
	const struct incise_bytes *files[FILES] = {
		[SIGNATURE] = signature,
		[SIGNERS] = signers ? &signers->allowed : NULL,
		[REVOKED] = signers ? &signers->revoked : NULL,
	};
	struct check check = {.text = text};
	int rc = 0;

	print_time(check.at, sizeof(check.at), at_s < 0 ? time(NULL) : at_s);
	for (int i = 0; i < FILES; i++) {
		check.fd[i] = files[i] && files[i]->bytes
				      ? make_file(files[i]->bytes, files[i]->n)
				      : -1;
		if (files[i] && files[i]->bytes && check.fd[i] < 0)
			rc = incise_error_set(err, errno, "ssh-keygen: %s",
					      strerror(errno));
		sprintf(check.path[i], "/proc/self/fd/%d", check.fd[i]);
	}
	if (!rc)
		rc = check_text(&check, voucher, err);
	if (!rc && voucher->verdict == INCISE_PROOF_UNCHECKED && signers) {
		voucher->verdict = INCISE_PROOF_BAD;
		rc = check_signers(&check, voucher, err);
	}
	for (int i = 0; i < FILES; i++)
		if (check.fd[i] >= 0)
			close(check.fd[i]);
	return rc;
}
