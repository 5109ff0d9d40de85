// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Signatures of OpenSSH; see signature.h. ssh-keygen is run without a shell. It reads all that is
 * not trusted from files in memory, whose names are not those of a recording.
 */
#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>
#include <incise/infile.h>
#include "../cli/child.h"
#include "../cli/cli.h"
#include "../cli/control_character.h"
#include "../cli/file.h"
#include "signature.h"

#define ANSWER_MAX (2 * SIGNATURE_MAX)

/* A file in memory with these bytes, ready to be read. */
static struct memory_file memory_of(const char *bytes, size_t n)
{
	struct memory_file file = memory_file_begin("seal");

	fwrite(bytes, 1, n, file.file);
	memory_file_written(&file);
	rewind(file.file);
	return file;
}

/* The text that a program wrote there, of at most ANSWER_MAX bytes: free(3). Closes it. */
static char *answer_of(struct memory_file *file)
{
	char *text = cli_alloc(ANSWER_MAX + 1, 1);
	ssize_t n = pread(fileno(file->file), text, ANSWER_MAX, 0);

	text[n > 0 ? n : 0] = 0;
	fclose(file->file);
	return text;
}

struct keygen {
	bool good;    /* exit status 0 */
	char *out;    /* standard output */
	char *errors; /* "" if they went to the terminal */
};

static void keygen_end(struct keygen *keygen)
{
	free(keygen->out);
	free(keygen->errors);
}

/* Run it on a text. @ask: it may ask on the terminal. Returns 0 or -errno. */
static int keygen_run(struct keygen *keygen, char *const argv[], const char *text,
		      size_t n, bool ask, struct incise_error *err)
{
	struct memory_file in = memory_of(text, n);
	struct memory_file out = memory_file_begin("seal");
	struct memory_file errors = memory_file_begin("seal");
	int status = child_run(argv, fileno(in.file), fileno(out.file),
			       ask && isatty(STDERR_FILENO) ? STDERR_FILENO
							    : fileno(errors.file));
	int code = errno;

	fclose(in.file);
	keygen->out = answer_of(&out);
	keygen->errors = answer_of(&errors);
	keygen->good = status >= 0 && WIFEXITED(status) && !WEXITSTATUS(status);
	if (status >= 0)
		return 0;
	return incise_error_set(err, code,
				"ssh-keygen: %s; apt-get install openssh-client",
				strerror(code));
}

/* The last line of a text that is not empty, in place. */
static char *last_line(char *text)
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
	if (!S_ISREG(st.st_mode) || st.st_size > SIGNATURE_MAX)
		return incise_error_set(
			err, EINVAL,
			"%s: not the file of a key; give a private key, or "
			"the public key of one in the agent",
			key);
	return 0;
}

char *signature_make(const char *key, const char *text, size_t n,
		     struct incise_error *err)
{
	char *argv[] = {"ssh-keygen",	     "-Y", "sign", "-q", "-f", (char *)key, "-n",
			SIGNATURE_NAMESPACE, NULL};
	struct keygen keygen;

	if (check_key(key, err) || keygen_run(&keygen, argv, text, n, true, err))
		return NULL;
	if (keygen.good && strlen(keygen.out) <= SIGNATURE_MAX &&
	    !strncmp(keygen.out, "-----BEGIN SSH SIGNATURE-----", 29)) {
		free(keygen.errors);
		return keygen.out;
	}
	incise_error_set(err, EACCES, "%s: ssh-keygen did not sign with this key%s%.200s",
			 key, *keygen.errors ? ": " : "", last_line(keygen.errors));
	keygen_end(&keygen);
	return NULL;
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

int signers_read(struct signers *signers, const char *path, const char *revoked,
		 struct incise_error *err)
{
	*signers = (struct signers){.path = path};
	signers->text = incise_infile_read(path, &signers_kind, &signers->n, err);
	if (signers->text && revoked)
		signers->revoked = incise_infile_read(revoked, &revoked_kind,
						      &signers->n_revoked, err);
	return !signers->text || (revoked && !signers->revoked) ? -errno : 0;
}

void signers_free(struct signers *signers)
{
	free(signers->text);
	free(signers->revoked);
}

/* Copy text that ssh-keygen printed, which may hold anything. */
static void copy(char *to, size_t size, const char *text, size_t n)
{
	n = strnlen(text, n < size ? n : size - 1);
	memcpy(to, text, n);
	to[n] = 0;
	control_characters_hide(to);
}

/* "Good "incise" signature with ED25519 key SHA256:…": what is behind "with", without "key". */
static void copy_key(struct signature *signature, char *line)
{
	char *with = strstr(line, " with "), *key = with ? strstr(with, " key ") : NULL;

	if (!key)
		return;
	line[strcspn(line, "\r\n")] = 0;
	memmove(key + 1, key + 5, strlen(key + 5) + 1);
	copy(signature->key, sizeof(signature->key), with + 6, sizeof(signature->key));
}

/* The reason that ssh-keygen gives, "PATH:1: key has expired: …", without its path. */
static void copy_reason(struct signature *signature, const char *errors,
			const char *otherwise)
{
	static const char *const reasons[] = {"key has expired", "key is not yet valid",
					      "key is not permitted"};

	for (size_t i = 0; i < sizeof(reasons) / sizeof(*reasons); i++) {
		const char *reason = strstr(errors, reasons[i]);

		if (!reason)
			continue;
		copy(signature->why, sizeof(signature->why), reason,
		     strcspn(reason, "\r\n"));
		return;
	}
	snprintf(signature->why, sizeof(signature->why), "%s", otherwise);
}

struct check {
	struct memory_file bytes, signers, revoked;
	char at[40]; /* "-Overify-time=…" */
	const char *text;
	size_t n;
};

static void time_text(char *text, size_t size, int64_t at_s)
{
	time_t t = at_s;
	struct tm tm;

	if (gmtime_r(&t, &tm))
		strftime(text, size, "-Overify-time=%Y%m%d%H%M%SZ", &tm);
}

/* Whether the signer may have made it: *good, else the reason. Returns 0 or -errno. */
static int check_signer(const struct check *check, struct signature *signature,
			const char *signer, bool revoked, bool *good,
			struct incise_error *err)
{
	char *argv[] = {"ssh-keygen",
			"-Y",
			"verify",
			"-n",
			SIGNATURE_NAMESPACE,
			"-s",
			(char *)check->bytes.path,
			"-f",
			(char *)check->signers.path,
			"-I",
			(char *)signer,
			(char *)check->at,
			revoked ? "-r" : NULL,
			(char *)check->revoked.path,
			NULL};
	struct keygen keygen;
	int rc = keygen_run(&keygen, argv, check->text, check->n, false, err);

	*good = !rc && keygen.good;
	if (!rc && !*good)
		copy_reason(signature, keygen.errors,
			    "its key is not allowed to sign this");
	keygen_end(&keygen);
	if (rc || *good || !revoked)
		return rc;
	/* It gives no reason if a key is revoked: then this alone makes the difference. */
	rc = check_signer(check, signature, signer, false, good, err);
	if (!rc && *good)
		strcpy(signature->why,
		       "its key is revoked, or the file of revoked keys is not valid");
	*good = false;
	return rc;
}

/* The same for all that may have made it by their keys. */
static int check_signers(const struct check *check, struct signature *signature,
			 bool revoked, struct incise_error *err)
{
	char *argv[] = {"ssh-keygen",
			"-Y",
			"find-principals",
			"-s",
			(char *)check->bytes.path,
			"-f",
			(char *)check->signers.path,
			(char *)check->at,
			NULL};
	struct keygen keygen;
	bool good = false;
	int rc = keygen_run(&keygen, argv, "", 0, false, err);

	if (!rc && !keygen.good)
		copy_reason(signature, keygen.errors, "no signer has its key");
	for (char *save,
	     *signer = keygen.good ? strtok_r(keygen.out, "\r\n", &save) : NULL;
	     signer && !good && !rc; signer = strtok_r(NULL, "\r\n", &save)) {
		/* Those that a pattern leaves out are listed, too. */
		if (*signer == '!')
			continue;
		rc = check_signer(check, signature, signer, revoked, &good, err);
		if (!good)
			continue;
		signature->verdict = SIGNATURE_GOOD;
		*signature->why = 0;
		/* A pattern names no one person. */
		snprintf(signature->signer, sizeof(signature->signer), "%s%s",
			 strpbrk(signer, "*?") ? "one of " : "", signer);
		control_characters_hide(signature->signer);
	}
	keygen_end(&keygen);
	return rc;
}

int signature_check(struct signature *signature, const char *text, size_t n,
		    const char *bytes, size_t n_bytes, const struct signers *signers,
		    int64_t at_s, struct incise_error *err)
{
	struct check check = {.bytes = memory_of(bytes, n_bytes), .text = text, .n = n};
	char *argv[] = {"ssh-keygen",	     "-Y", "check-novalidate", "-n",
			SIGNATURE_NAMESPACE, "-s", check.bytes.path,   NULL};
	struct keygen keygen;
	int rc = keygen_run(&keygen, argv, text, n, false, err);
	bool revoked = signers && signers->revoked;

	*signature = (struct signature){.verdict = SIGNATURE_WRONG};
	time_text(check.at, sizeof(check.at), at_s < 0 ? time(NULL) : at_s);
	if (!rc && keygen.good) {
		signature->verdict = SIGNATURE_UNKNOWN;
		copy_key(signature, keygen.out);
	} else if (!rc) {
		snprintf(signature->why, sizeof(signature->why), "%s",
			 strstr(keygen.errors, "namespace")
				 ? "it is a signature for another purpose"
			 : strstr(keygen.errors, "incorrect signature")
				 ? "it is a signature over another statement"
				 : "it is no signature of OpenSSH");
	}
	keygen_end(&keygen);
	if (!rc && signature->verdict == SIGNATURE_UNKNOWN && signers) {
		check.signers = memory_of(signers->text, signers->n);
		if (revoked)
			check.revoked = memory_of(signers->revoked, signers->n_revoked);
		rc = check_signers(&check, signature, revoked, err);
		fclose(check.signers.file);
		if (revoked)
			fclose(check.revoked.file);
	}
	fclose(check.bytes.file);
	return rc;
}
