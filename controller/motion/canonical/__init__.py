"""The canonical body: conversion of recordings to it, edits of clips, and warnings about recorded bodies."""
