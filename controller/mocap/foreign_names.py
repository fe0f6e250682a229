"""Names of the body in other languages than English, and the English word that `bone_names` knows for each."""

from __future__ import annotations

import unicodedata

# German, Spanish, French, Italian, Portuguese; Japanese as MikuMikuDance has it. Without accents, sharp s as ss.
_WORDS = {
    "hips": "huefte huften becken cadera caderas bassin hanche hanches bacino anca anche quadril センター 腰",
    "hip": "hufte",
    "spine": "wirbelsaule wirbelsaeule rucken ruecken columna espalda colonne dos colonna schiena coluna 上半身",
    "chest": "brust brustkorb pecho torax poitrine torace petto peito",
    "neck": "hals nacken cuello cou collo pescoco 首",
    "head": "kopf cabeza tete testa cabeca 頭",
    "thigh": "oberschenkel muslo cuisse coscia coxa 足",
    "leg": "bein pierna jambe gamba perna",
    "shin": "unterschenkel espinilla mollet polpaccio canela",
    "knee": "knie rodilla genou ginocchio joelho ひざ",
    "ankle": "knochel knoechel sprunggelenk tobillo cheville caviglia tornozelo 足首",
    "foot": "fuss pie pied piede",
    "toes": "zehen zeh dedospie orteils orteil つま先",
    "clavicle": "schlusselbein schluesselbein clavicula clavicola",
    "shoulder": "schulter hombro epaule spalla ombro 肩",
    "upperarm": "oberarm brazo bras braccio braco 腕",
    "forearm": "unterarm antebrazo avantbras avambraccio antebraco",
    "elbow": "ellbogen ellenbogen codo coude gomito cotovelo ひじ",
    "hand": "mano main mao",
    "wrist": "handgelenk muneca poignet polso pulso 手首",
}
ENGLISH = {word: english for english, words in _WORDS.items() for word in words.split()}
_SIDES = {
    "left": "links linker linke linkes izquierda izquierdo izq gauche sinistra sinistro sx esquerda esquerdo 左",
    "right": "rechts rechter rechte rechtes derecha derecho der droite droit destra destro dx direita direito 右",
}
LEFT, RIGHT = (frozenset(_SIDES[side].split()) for side in ("left", "right"))


def without_accents(name: str) -> str:
    """A name without the marks that letters bear; letters of other alphabets stay."""
    if name.isascii():
        return name
    marked = unicodedata.normalize("NFKD", name.replace("ß", "ss"))
    return unicodedata.normalize("NFC", "".join(c for c in marked if not "\u0300" <= c <= "\u036f"))
